"""FMUs in a process of their own, which is supervised: see `room.py`."""
