"""Close the loop on several experiments: each by itself, then compare their findings in one table."""

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from joblib import cpu_count

from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.several.common import commons
from estimator.closeloop.several.standing import standing
from estimator.closeloop.several.transfer import Traced, transfers
from estimator.plant import PLANTS
from estimator.workers import workers_end_too
from fmus.errors import BadInput
from fmus.export.provenance import checksum
from fmus.host.apart.isolation import ISOLATED, Isolation
from scenarios.closing.closing import (
    Posed,
    Tell,
    closed,
    experiment_of,
    stages_of,
)
from scenarios.closing.page.glossary import glossary
from scenarios.closing.result import Result
from scenarios.closing.several_page import write_page
from scenarios.closing.several_results import (
    Carried,
    Joint,
    Results,
    carried,
    joint,
    together,
)
from scenarios.closing.suspicion import suspicions
from scenarios.experiment.conversions import Show, conversion_lines
from scenarios.experiment.experiment import Experiment
from scenarios.output import writable, written_at_once

Done = Callable[[Result], None]
OURS = ("index.html", "table.csv", "results.json")  # written beside the folders of the experiments


@workers_end_too()
def close_loops(
    experiments: Sequence[str | Path],
    out: str | Path | None = None,
    data_dir: str | Path | None = None,
    tell: Tell = lambda _: None,
    done: Done = lambda _: None,
    jobs: int | None = None,
    seed: int = 0,
    resume: bool = False,
    isolation: Isolation | None = ISOLATED,
    show: Show = lambda _: None,
) -> Results:
    """Run `railfmi close-loop` on several experiments; see close_loop for a single one.

    The results of each experiment are written to `out`/ID; index.html, table.csv and results.json, which
    cover all experiments, are written to `out`. If experiments use the same FMU, each effect found is tested
    on the other records and fitted jointly to all records that show it.
    done: called with each result as soon as it is finished. isolation: see close_loop.
    After Ctrl-C, the finished results are kept, and `interrupted` is set in the result.
    Raises BadInput if an experiment is wrong, before the first one is run.
    """
    declared = experiments_of(experiments, data_dir)
    with tempfile.TemporaryDirectory(prefix="railfmi_loops_") as work:
        posed = [_posed(e, Path(work) / f"{i}", isolation) for i, e in enumerate(declared)]
        for p in posed:
            show([f"{p.declared.id}:", *conversion_lines(p.problem.record), *suspicions(p.problem)])
        campaign = _Campaign(posed, None if out is None else writable(Path(out)), jobs or cpu_count())
        try:
            campaign.run(tell, done, seed, resume)
        except KeyboardInterrupt:
            campaign.interrupted = True
        finally:
            PLANTS.close()
            found = campaign.results()
            if campaign.folder is not None and found.results:
                with written_at_once(campaign.folder) as part:
                    found.write(part)
                    write_page(part, found)
    return found


def experiments_of(paths: Sequence[str | Path], data_dir: str | Path | None = None) -> list[Experiment]:
    """Read experiments, each of which can have a folder of its own, named by its id, beside the common table.

    Raises BadInput if one is wrong, if there is none, or if an id is used twice or names no such folder.
    """
    declared = [experiment_of(path, data_dir) for path in paths]
    if not declared:
        raise BadInput("no experiment given; name at least one experiment.toml")
    files: dict[str, Path] = {}
    for e in declared:
        if e.id in files:
            raise BadInput(
                f"{e.file}: id '{e.id}' is also used by {files[e.id]}; give each experiment an id of its own"
            )
        if Path(e.id).name != e.id or e.id in (*OURS, ".."):
            raise BadInput(
                f"{e.file}: id '{e.id}' cannot name a folder beside {', '.join(OURS)}; choose another id"
            )
        files[e.id] = e.file
    return declared


def _posed(e: Experiment, work: Path, isolation: Isolation | None) -> Posed:
    """Read all files of an experiment; experiments with the same model share one folder of builds."""
    folder = work if e.model is None else work.parent / e.model
    folder.mkdir(exist_ok=True)
    return Posed.of(e, folder, isolation)


def fmu_of(e: Experiment) -> str:
    """A key that is equal for experiments with the same FMU: the model's name, or the file's checksum."""
    return checksum(e.fmu_path) if e.fmu_path else (e.model or "").lower()


@dataclass
class _Campaign:
    """Several experiments in progress; finished results are kept if a later experiment fails."""

    posed: Sequence[Posed]
    folder: Path | None
    jobs: int
    finished: list[Result] = field(default_factory=list)
    carried: list[Carried] = field(default_factory=list)
    joint: list[Joint] = field(default_factory=list)
    together: dict[str, str] = field(default_factory=dict)
    units: dict[str, dict[str, str]] = field(default_factory=dict)
    interrupted: bool = False

    def run(self, tell: Tell, done: Done, seed: int, resume: bool) -> None:
        """Run each experiment, then compare the experiments that use the same FMU."""
        groups: dict[str, list[Traced]] = {}
        kept: list[Stages] = []
        for p in self.posed:
            e, folder, begun = p.declared, self.folder, time.monotonic()
            here = None if folder is None else writable(folder / e.id)
            kept.append(stages_of(e, here, seed, resume))
            outcome, result = closed(p, here, _prefixed(tell, e.id), self.jobs, seed, begun, kept[-1])
            groups.setdefault(fmu_of(e), []).append(Traced(e.id, outcome.baseline.problem, outcome))
            self.finished.append(result)
            words = glossary(p.problem, ())
            self.units[e.id] = {o: words.unit(o) for o in p.problem.record.outputs}
            done(result)
        for records in groups.values():
            if len(records) > 1:
                self._compare(records, tell)
        for stages in kept:
            stages.forget()

    def _compare(self, records: Sequence[Traced], tell: Tell) -> None:
        """Test each effect on the other records, and fit the ones left to all records that show them."""
        found = []
        for a in records:
            for b in records:
                if a is not b and a.members:
                    tell(f"testing the effects found in {a.name} on {b.name}")
                    new = transfers(a, b, self.jobs)
                    found += new
                    self.carried += [carried(t, b) for t in new]
        standings = [standing(a, found) for a in records]
        self.together |= together(standings)
        tell("fitting effects that several experiments show with one value for all of them")
        left = [h for s in standings for h in s.left]
        by_name = {r.name: r for r in records}
        self.joint += [joint(c, by_name[c.names[0]]) for c in commons(records, found, left, self.jobs)]

    def results(self) -> Results:
        """The results finished so far."""
        return Results(self.finished, self.carried, self.joint, self.together, self.units, self.interrupted)


def _prefixed(tell: Tell, name: str) -> Tell:
    return lambda said: tell(f"{name}: {said}")
