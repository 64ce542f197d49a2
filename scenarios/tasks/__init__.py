"""Many small tasks on many processes: each is done once, kept in a file, and written in a fixed order."""
