"""Whether a filter still describes what it is fed: a sequential test with a stated rate of false alarms."""
