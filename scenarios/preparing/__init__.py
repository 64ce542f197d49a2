"""The way in: what a record and an FMU hold, an experiment drafted from both, and a trial before the run."""
