"""Close-loop on public measured benchmarks, each with an FMU that lacks a known effect."""
