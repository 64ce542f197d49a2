"""The challenge: a blind set of records from a seed, the chain's answers to them, and a scoreboard."""
