"""What is being done, said as it begins, and how long each stage took."""

from collections.abc import Callable
from time import monotonic

Tell = Callable[[str], None]


class Progress:
    """Says what begins and counts the seconds of wall time of each stage, by its name, in their order."""

    def __init__(self, tell: Tell) -> None:
        self._tell, self._now, self._since = tell, "", monotonic()
        self.seconds: dict[str, float] = {}

    def __call__(self, stage: str, sentence: str) -> None:
        """A stage begins, so that the one before has ended."""
        self.end()
        self._now = stage
        self._tell(sentence)

    def end(self) -> None:
        """The last stage has ended."""
        now = monotonic()
        if self._now:
            self.seconds[self._now] = self.seconds.get(self._now, 0.0) + now - self._since
        self._now, self._since = "", now
