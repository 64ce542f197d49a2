"""What a command says and how loudly: its answer on the output, everything else on the error stream."""

import dataclasses
import json
import math
import re
import threading
import time
import unicodedata
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

if TYPE_CHECKING:
    import pandas as pd

COUNT = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?) of (\d+(?:\.\d+)?)")
PATIENCE = 2.0  # s, from which on progress is told
INTERVAL = 10.0  # s, between two lines of progress where there is no terminal, at first;
SHARE = 0.1  # later as a share of the time that has passed, since a log of hours is not read line by line
TICK = 0.5  # s, between two drawings of the progress

UNPRINTABLE = "\N{REPLACEMENT CHARACTER}"
# categories of Unicode: controls, formats such as a change of direction, surrogates
OBEYED = ("Cc", "Cf", "Cs")

said = Console(stderr=True, highlight=False)


def visible(text: object) -> str:
    """A text without what a terminal would obey: names in an FMU or a file may hold its codes."""
    return "".join(
        UNPRINTABLE if unicodedata.category(c) in OBEYED and c not in "\n\t" else c for c in str(text)
    )


class Voice:
    """What the options -v, -q and --json ask for, and with --json what the answer is made of."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Before a command: as loud as usual, nothing answered."""
        self.quiet = self.verbose = self.as_json = False
        self.lines: list[str] = []
        self.result: Any = None
        self.error = ""

    def echo(self, line: object) -> None:
        """A line of the answer."""
        self.lines.append(str(line))
        if not self.as_json:
            print(visible(line))

    def echo_coloured(self, line: str) -> None:
        """A line of the answer with colours, as the library rich writes them."""
        self.lines.append(Text.from_markup(line).plain)
        if not self.as_json:
            Console(highlight=False, soft_wrap=True).print(visible(line))

    def found(self, result: object) -> None:
        """What the answer is made of, for --json; of several, a list."""
        self.result = plain(result)

    def document(self, command: str, code: int, error: str = "") -> str:
        """The answer as JSON."""
        value = {"command": command, "exit": code, "result": self.result, "lines": self.lines}
        return json.dumps(value | ({"error": error} if error else {}), indent=1, ensure_ascii=False)


VOICE = Voice()
echo, echo_coloured, found = VOICE.echo, VOICE.echo_coloured, VOICE.found


def plain(value: Any) -> Any:
    """A value as JSON has it: dataclasses as objects, paths as text, null for a number that is not finite."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(v) for v in value]
    if isinstance(value, bool | int | str) or value is None:
        return value
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):  # of NumPy
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value)


def rows_of(table: "pd.DataFrame") -> list[dict[str, Any]]:
    """The rows of a table by the names of its columns and of its index, for --json."""
    return [{str(name): x for name, x in row.items()} for row in table.reset_index().to_dict("records")]


class Progress:
    """The step that a command is at, with its count, the elapsed and the expected time.

    clock: s; show: takes the text that is shown or, off a terminal, printed.
    """

    def __init__(self, text: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._begin = self._since = clock()
        self._text = text
        self._first = 0.0

    def update(self, text: str) -> None:
        """The step has changed, or its count."""
        if step_of(text) != step_of(self._text):
            self._since = self._clock()
            self._first = _count(text)[0]
        self._text = text

    @property
    def elapsed(self) -> float:
        """Time since the beginning, s."""
        return self._clock() - self._begin

    def __str__(self) -> str:
        now = self._clock()
        done, all_ = _count(self._text)
        left = ""
        if all_ > done > self._first:
            each = (now - self._since) / (done - self._first)
            left = f", about {span(each * (all_ - done))} left in this step"
        return f"{self._text} ({span(now - self._begin)}{left})"


def step_of(text: str) -> str:
    """What a text of progress says before its count, which stays the same while the count rises."""
    counted = COUNT.search(text)
    return text[: counted.start()] if counted else text


def _count(text: str) -> tuple[float, float]:
    """The count in a text such as 'fitting, 3 of 40' or 'simulating, 2.50 of 10 s'; zeros without one."""
    counted = COUNT.search(text)
    return (float(counted[1]), float(counted[2])) if counted else (0.0, 0.0)


def span(seconds: float) -> str:
    """A time as it is read: 8 s, 3 min 20 s."""
    whole = round(seconds)
    return f"{whole} s" if whole < 60 else f"{whole // 60} min {whole % 60:02d} s"


@contextmanager
def progress(text: str) -> Iterator[Progress]:
    """Tell on the error stream what a command is at, once it takes longer than two seconds.

    On a terminal one line is drawn again and again; elsewhere there is a line now and then, with -v one for
    each step, with -q none.
    """
    shown, over = Progress(text), threading.Event()
    teller = threading.Thread(target=_tell, args=(shown, over), daemon=True)
    if not VOICE.quiet:
        teller.start()
    try:
        yield shown
    finally:
        over.set()
        if not VOICE.quiet:
            teller.join()


def _tell(shown: Progress, over: threading.Event) -> None:
    if said.is_terminal and not VOICE.verbose:
        if over.wait(PATIENCE):
            return
        with said.status(visible(shown)) as status:
            while not over.wait(TICK):
                status.update(visible(shown))
        return
    last, step = time.monotonic() + PATIENCE - INTERVAL, ""
    while not over.wait(TICK):
        now, text = time.monotonic(), shown._text
        interval = max(INTERVAL, SHARE * shown.elapsed)
        due = now - last >= interval or (VOICE.verbose and step_of(text) != step_of(step))
        if due:
            said.print(f"... {visible(shown)}", markup=False, soft_wrap=True)
            last, step = now, text
