"""Sources that several limits share."""

CHALLENGE = "calibrated on the challenges up to seed 591988, frozen at 9217a2d"
