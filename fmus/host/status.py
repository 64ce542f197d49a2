"""What a call of an FMU says of itself, and what is raised where it did not succeed."""

OK, WARNING, DISCARD, ERROR, FATAL = 0, 1, 2, 3, 4
WORDS = ("OK", "warning", "discard", "error", "fatal", "pending")


class CallFailed(Exception):
    """An FMI call that did not succeed, with what the FMU logged about it."""


class AskedToEnd(CallFailed):
    """The FMU wants to end the simulation, to which the standard entitles it."""


def failure(call: str, status: int) -> str:
    """The sentence that a call failed with a status."""
    word = WORDS[status] if 0 <= status < len(WORDS) else "not of the standard"
    return f"{call} failed with status {status} ({word})"
