"""Results that are kept in the tree: what a change of the code must not change without a word."""

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.challenge.draw import plans
from benchmarks.challenge.make import make
from scenarios.closing.result import Result

FOLDER = Path(__file__).parent
SEED, COUNT = 20, 24  # of the challenge that the records are from
ROUNDED = 1e-3  # relative; a standard error differed by 1.5e-4 between processors with and without AVX-512
CHALLENGE = (7, 12, 15, 20)  # a sensor's fault, a class of two, an effect, and nothing


def challenge_record(index: int, work: Path) -> Path:
    """The folder of a record of the challenge."""
    plan = plans(SEED, COUNT)[index]
    make(plan, SEED, work / "records", work / "truth")
    return work / "records" / plan.name


def figures(result: Result) -> dict[str, Any]:
    """What is kept of a result: the answer with what it was decided by, and what was calibrated."""
    effects = [{"kind": e.kind, "location": e.location, **e.parameters} for e in result.effects]
    checks = [{key: c[key] for key in ("check", "value", "limit", "passed")} for c in result.decision]
    kept = {
        "verdict": result.verdict, "policy": result.policy, "decision": checks, "effects": effects,
        "calibrated": result.calibrated, "error": result.error,
    }  # fmt: skip
    told: dict[str, Any] = json.loads(json.dumps(kept))
    return told


def write(name: str, result: Result) -> None:
    """Keep a result."""
    (FOLDER / f"{name}.json").write_text(json.dumps(figures(result), indent=1) + "\n", encoding="utf-8")


def read(name: str) -> dict[str, Any]:
    """The result that was kept."""
    kept: dict[str, Any] = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return kept


def alike(found: Any, kept: Any, at: str = "") -> None:
    """Assert that what was found is what was kept, but for what other compilers and processors round."""
    if isinstance(kept, dict):
        assert found.keys() == kept.keys(), at
        for key in kept:
            alike(found[key], kept[key], f"{at}.{key}")
    elif isinstance(kept, list):
        assert len(found) == len(kept), at
        for i, (a, b) in enumerate(zip(found, kept, strict=True)):
            alike(a, b, f"{at}[{i}]")
    elif isinstance(kept, float):
        assert found == pytest.approx(kept, rel=ROUNDED, abs=1e-9), at
    else:
        assert found == kept, at
