"""The groups of measurements, one file each."""
