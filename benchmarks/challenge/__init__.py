"""The challenge: a blind set of records from a seed, the answers of close-loop to them, and a scoreboard."""
