"""Run one case in one tool: MODULE FOLDER, the case as JSON at the input; rows as JSON in the last line."""

import importlib
import json
import sys
from pathlib import Path

from tests.contracts.interop.importer import Case, Importer, every

module, folder = sys.argv[1:]
importlib.import_module(module)
[tool] = [c for c in every(Importer) if c.__module__ == module]
rows = tool().run(Case(**json.load(sys.stdin)), Path(folder))
print("\nROWS", json.dumps([[float(v) for v in row] for row in rows]), flush=True)
