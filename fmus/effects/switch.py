"""A call of a law's formula that may be passed over while the law is off."""

import re
from typing import NamedTuple

NAME = re.compile(r"off_(\d+)_to_(\d+)_(zero_)?")


class Switch(NamedTuple):
    """Of the arguments of a call, one after the other, those from `first` to before `end` switch it on.

    through: whether its first result, if it is off, is the first argument. All others are zero then.
    """

    first: int
    end: int
    through: bool

    def name(self, kind: str) -> str:
        """The name of a function that is called so, which keeps what it is when the function is copied."""
        return f"off_{self.first}_to_{self.end}_{'' if self.through else 'zero_'}{kind}"

    @staticmethod
    def of(name: str) -> "Switch | None":
        """The switch of a function by its name; None for functions that are always called."""
        found = NAME.search(name)
        return Switch(int(found[1]), int(found[2]), not found[3]) if found else None
