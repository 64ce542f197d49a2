"""Close the loop on one record: `python -m benchmarks.challenge.answer RECORD ANSWER CORES`.

With the further argument `ablate`, its fits are judged again by every policy of the ablation; the times are
those of the answer alone.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

from estimator.closeloop.checkpoints import Stages
from estimator.plant import PLANTS
from scenarios.closing.closing import Posed, closed, experiment_of


def main() -> None:
    """Close the loop on a record and write the result with its processor time."""
    record, answer, cores = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    begun = time.monotonic()
    declared = experiment_of(record)
    with tempfile.TemporaryDirectory() as work:
        posed = Posed.of(declared, Path(work))
        found, result = closed(posed, None, lambda _: None, cores or None, 0, begun, Stages())
        told = {"result": asdict(result), "cpu_seconds": _used()}
        if "ablate" in sys.argv[4:]:
            from benchmarks.challenge.ablation import ablated  # loads truth models, which an answer must not

            told |= {"seconds": round(time.monotonic() - begun, 1), "ablation": ablated(found)}
            PLANTS.close()
        answer.write_text(json.dumps(told), encoding="utf-8")


def _used() -> float:
    """Processor time of this process and of its workers that have ended, s."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return round(sum(u.ru_utime + u.ru_stime for u in used), 1)


if __name__ == "__main__":
    main()
