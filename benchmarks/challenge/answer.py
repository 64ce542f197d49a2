"""One record closed in a process of its own: `python -m benchmarks.challenge.answer RECORD ANSWER CORES`."""

from __future__ import annotations

import json
import resource
import sys
from dataclasses import asdict
from pathlib import Path

from scenarios import close_loop


def main() -> None:
    """Close the loop on a record and write the result with the processor time that it took."""
    record, answer, cores = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    result = close_loop(record, jobs=cores or None)
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    cpu = sum(u.ru_utime + u.ru_stime for u in used)
    answer.write_text(json.dumps({"result": asdict(result), "cpu_seconds": round(cpu, 1)}), encoding="utf-8")


if __name__ == "__main__":
    main()
