"""A stream of windows through one filter: the command `watch`."""
