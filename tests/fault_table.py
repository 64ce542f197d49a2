"""The table of faults in docs/faults.md, from the cases of the tests; run as a module, this writes it."""

from collections.abc import Iterator
from pathlib import Path

from tests.contracts import test_fuzzed_files
from tests.helpers.full_disk import TEMPORARY
from tests.helpers.fuzzing import targets
from tests.helpers.interrupting import SIGNALS
from tests.helpers.misbehaving import AT_THE_END, DEATHS, ENDLESS, HARMLESS, NOT_FINITE, REFUSALS
from tests.helpers.small_commands import EVERY_COMMAND
from tests.scenarios import (
    test_command_line,
    test_contained,
    test_full_disk,
    test_hostile_xml,
    test_interrupts_at_random,
    test_links,
    test_misbehaving,
    test_output,
    test_trials_before,
)

FILE = Path(__file__).parents[1] / "docs" / "faults.md"
HEAD = """# Faults that the tests try

Written by `python -m tests.fault_table` from the cases of the tests. The FMUs that misbehave are compiled
from [one C file](../tests/helpers/c/misbehaving.c), in which the fault has the name that stands in backticks
here. The word after "in" says in which call it happens: `load`, `instantiate` and so on up to `free`; a
fault in `late` happens in `fmi2DoStep` at t = 0.05 s. "One line" and "one sentence" are printed on the error
stream. "All commands" are
{commands}.

In short: an FMU that crashes, hangs, takes all memory or returns an error ends the command with one
sentence that names the FMU, the call and the time, and exit code 2; what was recorded or finished is kept.
Numbers that are not finite never pass for a result. A full disk, a signal or a damaged file leaves no
half-written result. Archives and XML that would harm the machine are refused before anything of them is
used.

| fault | command | what happens | test |
|---|---|---|---|
"""
SENTENCE = "one sentence with FMU, call and time, exit code 2"
KEPT = "; `run` keeps the recording"


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Fault, command, what happens, file of the test."""
    every = "all commands"
    file = _file(test_misbehaving)
    for fault in DEATHS:
        yield f"`{fault.what}` in {fault.call}", every, SENTENCE + KEPT * (fault.call == "late"), file
    for fault in ENDLESS:
        what = "ended after --call-limit, " + SENTENCE + KEPT * (fault.call == "late")
        yield f"`{fault.what}` in {fault.call}", every, what, file
    for fault in REFUSALS:
        what = "one sentence with FMU, call and status, exit code 2" + KEPT * (fault.call == "late")
        yield f"`{fault.what}` in {fault.call}", "run", what, file
    for fault in AT_THE_END:
        yield f"`{fault.what}` in {fault.call}", "run", f"no result, {SENTENCE}{KEPT}", file
    for fault in NOT_FINITE:
        yield f"outputs that are `{fault.what}`", "run", "no expectation over them is met, exit code 1", file
    for fault in HARMLESS:
        yield f"`{fault.what}` in {fault.call}", "run", "nothing: the run is as without it", file
    for what, words in test_trials_before.WRONG.items():
        told = f"refused before it is estimated: {words}; exit code 2"
        yield f"`{what}`", ", ".join(test_trials_before.COMMANDS), told, _file(test_trials_before)
    for what in test_output.SPOILED:
        yield f"model description with {what}", every, "one line, exit code 2", _file(test_output)
    for command in ("run", "compare"):
        for n in range(6):
            told = "one line, exit code 2, no half file"
            yield f"disk full from rename {n + 1} on", command, told, _file(test_output)
    for command, (_, most) in test_full_disk.CASES.items():
        whose = " of temporary files" * (test_full_disk.WHERE.get(command) == TEMPORARY)
        told = f"one line, exit code 2, no part of a file, at each of up to {most} places"
        yield f"disk{whose} full from any change of a file on", command, told, _file(test_full_disk)
    for command in EVERY_COMMAND:
        for number in SIGNALS:
            told = (
                "exit code of the signal, one line; no traceback, part of a file, process or folder is left"
            )
            times = test_interrupts_at_random.MOMENTS[command] // len(SIGNALS)
            yield f"{number.name} at {times} random moments", command, told, _file(test_interrupts_at_random)
    for command in test_interrupts_at_random.KILLED:
        told = (
            "no half file, no process; the next command goes on and removes what is left beside the results"
        )
        what = f"SIGKILL at {test_interrupts_at_random.MOMENTS[command]} random moments"
        yield what, command, told, _file(test_interrupts_at_random)
    for name in targets():
        told = f"it is read, or one line and exit code 2, of {test_fuzzed_files.MANY} spoiled files"
        yield f"`{name}` spoiled at random", "all that read it", told, _file(test_fuzzed_files)
        told = f"it is read, or one line and exit code 2, for {test_fuzzed_files.LONG} s of changes"
        what = f"`{name}` changed by a fuzzer that sees what is run"
        yield what, "all that read it", told, _file(test_fuzzed_files)
    for what in test_contained.MAT:
        formats = "HDF5 or MAT 7.3" if what in test_contained.H5 else "MAT 7.3"
        told = "one line, exit code 2; no other file is opened"
        yield f"a record of {formats} with {what}", "all that read it", told, _file(test_contained)
    for what in test_hostile_xml.ATTACKS:
        told = "it is read without it, or one line and exit code 2; no other file is opened"
        yield f"XML with {what}", "all that read an FMU or an SSP package", told, _file(test_hostile_xml)
    told = "one line, exit code 2"
    yield (
        "XML with entities that grow",
        "all that read an FMU or an SSP package",
        told,
        _file(test_hostile_xml),
    )
    for command, place in test_links.PLACES:
        told = "one line, exit code 2; nothing behind the link is changed"
        yield f"a link at `{place}` in --out", command, told, _file(test_links)
    for what in test_command_line.WRONG:
        told = "one line, exit code 2, nothing written"
        yield f"experiment: {what}", "close-loop", told, _file(test_command_line)
    for what, (arguments, _) in test_command_line.USAGE.items():
        told = "one line, exit code 2, nothing written"
        yield f"usage: {what}", arguments[0], told, _file(test_command_line)


def page() -> str:
    """The text of docs/faults.md."""
    lines = [f"| {' | '.join(row)} |\n" for row in rows()]
    return HEAD.format(commands=", ".join(test_misbehaving.COMMANDS)) + "".join(lines)


def _file(module: object) -> str:
    name = str(module.__name__).rpartition(".")[2]  # type: ignore[attr-defined]
    return f"`{name}`"


if __name__ == "__main__":
    FILE.write_text(page(), encoding="utf-8")
