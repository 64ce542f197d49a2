"""Files that a fuzzer changes by what each change makes the readers do; the good one is where it begins.

`python -m tests.helpers.fuzzing_by_coverage NAME SECONDS [SEED]` reads them for so long. The exit code is 0
if each was read or raised BadInput; otherwise a traceback is shown, and the file lies in the working folder.
It needs atheris, which is libFuzzer for Python (https://github.com/google/atheris).
"""

import os
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["fmus", "estimator", "scenarios"]):
    from fmus.errors import BadInput
    from tests.helpers.fuzzing import WORDS, targets

LONGEST = 1 << 14  # bytes of a file
SLOW = 60  # s, from which on the reading of one file counts as a mistake
MEMORY = 4096  # MB


def dictionary(file: Path) -> None:
    """Write the words that spoil files as libFuzzer reads them."""
    words = ("".join(rf"\x{byte:02x}" for byte in word) for word in WORDS if word)
    file.write_text("".join(f'"{word}"\n' for word in words), encoding="ascii")


def main(name: str, seconds: int, seed: int = 1) -> None:
    """Read changed files of a kind; libFuzzer ends the process."""
    target, work = targets()[name], Path(tempfile.mkdtemp(prefix="railfmi_fuzz_"))
    corpus = work / "corpus"
    corpus.mkdir()
    (corpus / "good").write_bytes(target.good)
    dictionary(work / "words")

    def one(data: bytes) -> None:
        (work / target.name).write_bytes(data)
        try:
            target.read(work / target.name)
        except BadInput:
            return

    asked = [
        f"-max_total_time={seconds}", f"-seed={seed}", f"-max_len={LONGEST}", f"-timeout={SLOW}",
        f"-rss_limit_mb={MEMORY}", f"-dict={work / 'words'}", "-print_final_stats=1", "-verbosity=0",
    ]  # fmt: skip
    atheris.Setup([sys.argv[0], *asked, str(corpus)], one)
    atheris.Fuzz()


if __name__ == "__main__":
    os.environ["PYTHONWARNINGS"] = "ignore"
    main(sys.argv[1], *map(int, sys.argv[2:]))
