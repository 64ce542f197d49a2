"""FMUs of another hand from their PythonFMU source, built on the fly without a network."""

import hashlib
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from fmus.errors import BadInput
from fmus.taken import check_text

PATIENCE = 600.0  # s, that a source may take to be imported and packed
SLAVE = re.compile(r"^class\s+\w+\(.*Fmi2Slave\b", re.MULTILINE)


def build_script(source: Path, out: Path) -> Path:
    """Write an FMU of the slave class in a PythonFMU source file into a folder; its path.

    The host imports the file by its plain name into its own interpreter, so it gets a name that carries a
    hash of its content. BadInput where the file is missing, or PythonFMU cannot build it in time.
    """
    try:
        check_text(source)
        text = source.read_bytes()
    except OSError as error:
        raise BadInput(f"source '{source}': cannot be read ({error.strerror}); mend the path") from error
    if not SLAVE.search(text.decode("utf-8", errors="replace")):
        raise BadInput(f"source '{source}': holds no class of pythonfmu's Fmi2Slave; write one")
    name = re.sub(r"\W", "_", source.stem)
    with tempfile.TemporaryDirectory(prefix="railfmi_") as folder:
        copy = Path(folder) / f"{name}_{hashlib.sha256(text).hexdigest()[:12]}.py"
        copy.write_bytes(text)
        # in a process of its own, as PythonFMU imports the file to look at it
        call = [sys.executable, "-m", "pythonfmu", "build", "-f", str(copy), "-d", folder]
        try:
            done = subprocess.run(call, capture_output=True, text=True, cwd=folder, timeout=PATIENCE)
        except subprocess.TimeoutExpired as error:
            raise BadInput(
                f"source '{source}': was not built within {PATIENCE:g} s; look at what it does on import"
            ) from error
        packed = sorted(Path(folder).glob("*.fmu"))
        if done.returncode or not packed:
            said = (done.stderr or done.stdout).strip().splitlines() or ["PythonFMU gave no reason"]
            raise BadInput(f"source '{source}': PythonFMU cannot build it: {said[-1]}")
        out.mkdir(parents=True, exist_ok=True)
        target = out / f"{name}.fmu"
        target.write_bytes(packed[0].read_bytes())
    return target
