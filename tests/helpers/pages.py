"""A document as what a reader does with it: files that it asks to save, and commands that it gives."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SAVED = re.compile(r"[Ss]ave this as\s`([\w./]+)`")


@dataclass(frozen=True)
class Step:
    """One thing that a reader does: a file to save (name, text), or a command line."""

    file: str = ""
    text: str = ""
    command: tuple[str, ...] = ()


def steps_of(page: Path, heading: str = "") -> Iterator[Step]:
    """What a page asks for, in its order; heading: only of the section with this heading."""
    text = page.read_text(encoding="utf-8")
    if heading:
        text = re.split(r"^## ", text.partition(f"## {heading}\n")[2], maxsplit=1, flags=re.M)[0]
    name = ""
    text = re.sub(r"([Ss]ave this as)\n", r"\1 ", text)  # a line may end there
    for block in re.finditer(r"```(\w*)\n(.*?)```|^    (\S[^\n]*)$|([^\n]+)\n", text, re.S | re.M):
        language, code, command, words = block.groups()
        if words and (found := SAVED.search(words)):
            name = found.group(1)
        elif language == "python":
            yield Step(file=name, text=code)
            name = ""
        elif command:
            yield Step(command=tuple(shlex.split(command, comments=True)))
