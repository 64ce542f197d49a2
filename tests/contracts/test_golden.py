"""Results stay as they are kept, and a verdict follows from nothing but its checks and the policy."""

from pathlib import Path

import pytest

from estimator.closeloop.evidence import Check, verdict_of
from estimator.closeloop.policy import DEFAULT
from scenarios import close_loop
from tests.golden.kept import CHALLENGE, FOLDER, alike, challenge_record, figures, read

KEPT = sorted(file.stem for file in FOLDER.glob("*.json"))
DECISION = DEFAULT.decision
LIMITS = {  # of the checks whose limit is one of the policy
    "the residual is more than noise": DEFAULT.detection.level,
    "the outputs move out of their noise": DEFAULT.detection.chance,
    "the size is clear of zero": DECISION.significant,
    "the reported size is clear of zero": DECISION.telling,
    "better than without it on the part to choose": DECISION.telling,
    "not improbable": DECISION.probable,
    "better than without it on the test part": DECISION.telling,
    "no worse than without it on the test part": -DECISION.telling,
}

AT_MOST = {  # all others have to reach their limit
    "the residual is more than noise",  # a probability
    "every sensor moves",
    "outputs left above their noise",
    "outputs left above their noise on the test part",
    "nothing richer gains on the part to identify",
    "the force follows the law",
    "alternatives that this record does not tell apart",
    "effects that are needed",
    "faults of sensors among them",
}


@pytest.mark.slow
@pytest.mark.parametrize("index", CHALLENGE)
def test_records_of_the_challenge_are_as_they_are_kept(index: int, tmp_path: Path) -> None:
    alike(figures(close_loop(challenge_record(index, tmp_path), jobs=1)), read(f"challenge-{index}"))


@pytest.mark.parametrize("name", KEPT)
def test_the_verdict_replays_from_the_decision_and_the_policy(name: str) -> None:
    kept = read(name)
    assert kept["policy"] == DEFAULT.version
    checks = []
    for c in kept["decision"]:
        value = float("inf") if c["value"] is None else c["value"]
        limit = LIMITS.get(c["check"], c["limit"])
        assert c["limit"] == limit
        passed = value <= limit if c["check"] in AT_MOST else value >= limit
        checks.append(Check(c["check"], value, limit, passed))
    assert [c.passed for c in checks] == [c["passed"] for c in kept["decision"]]
    assert verdict_of(checks) == kept["verdict"]
