"""Problems of tests, which are not simulated by an FMU."""


class OneByOne:
    """What the fits ask of a problem whose simulations are made one after the other."""

    at_once = 1

    def identify_residuals(self, thetas):
        """See Problem."""
        return None
