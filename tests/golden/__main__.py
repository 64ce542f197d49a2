"""Write the golden results anew: `python -m tests.golden`; a commit says why they differ."""

import tempfile
from pathlib import Path

from scenarios import close_loop
from tests.golden.kept import CHALLENGE, challenge_record, write
from tests.helpers.paths import SHIPPED

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as work:
        write("demo", close_loop(SHIPPED / "demo" / "rig-drag", jobs=1))
        for index in CHALLENGE:
            write(f"challenge-{index}", close_loop(challenge_record(index, Path(work)), jobs=1))
