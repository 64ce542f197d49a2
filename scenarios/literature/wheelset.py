"""Shared parts of the wheelset's rows: measurements, filters with and without the alignment, shaping."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path

import numpy as np

from estimator.filters.bounds import bounded
from estimator.filters.estimator import Adaptation
from estimator.filters.system import Joint, UnknownParameter, UnknownState
from estimator.filters.ukf import Ukf
from estimator.filters.unknown_input import Shaped
from fmus.model import declared
from fmus.models import model_class
from scenarios.estimating.form import largest_wandering, moved
from scenarios.estimating.policy import POLICY
from scenarios.literature.case import Record
from scenarios.literature.following import Followed, follow

V = 40.0  # m/s, thesis 4.6.1
DT = 1e-3  # s
ALIGNMENT = ("y_irr", "y_irr_dot")
NOISE = {"y": 1e-4, "psi": 1e-5, "y_dot": 1e-3, "psi_dot": 1e-3}
MEASURED = tuple(NOISE)

# start deviations, and process noise per second^1/2; a run begins at rest
STATES = (
    UnknownState("y", 0.0, std=1e-3, noise=1e-9),
    UnknownState("psi", 0.0, std=1e-3, noise=1e-9),
    UnknownState("y_dot", 0.0, std=1e-2, noise=1e-6),
    UnknownState("psi_dot", 0.0, std=1e-2, noise=1e-6),
    UnknownState("y_m", 0.0, std=1e-3, noise=1e-9),
    UnknownState("y_m_dot", 0.0, std=1e-2, noise=1e-6),
)
LEARNT = 15.0  # s of a record from which the alignment's shaping is learnt
DEVIATION = 0.8e-3  # m, of the alignment: thesis Table 3.1
SHAPES = tuple((f, d) for f in (1.0, 1.5, 2.0, 2.5) for d in (0.7, 1.0, 1.5))  # Hz and damping to choose from


@dataclass(frozen=True)
class Task:
    """The problem of a wheelset filter: one unknown parameter, the others as declared.

    noise: of the sensors as the filter takes it; adapt: whether it adapts the noise to its innovations.
    """

    fmu: Path
    parameter: UnknownParameter
    declared: Mapping[str, float]
    noise: Mapping[str, float] = field(default_factory=lambda: NOISE)
    adapt: Adaptation | None = None

    def known(self, record: Record, more: Sequence[UnknownParameter] = ()) -> Followed:
        """With the alignment known, and more unknown parameters."""
        with self._joint((), ALIGNMENT, more) as joint:
            return self._followed(joint, record, record.table(ALIGNMENT))

    def with_form(self, record: Record) -> Followed:
        """With the alignment known and the form of the contact open, as in the command estimate.

        The scales of the form are unknown, and the filter runs once for each choice of the form. The result
        is that of the likeliest choice; the scatter between the choices is a part of its error.
        """
        choices = model_class("wheelset").form_choices
        every = (dict(zip(choices, values, strict=True)) for values in product(*choices.values()))
        found = [replace(self, declared={**self.declared, **choice})._of_scales(record) for choice in every]
        best, name = max(found, key=lambda f: f.log_likelihood), self.parameter.name
        scatter = np.var([f.value[name] for f in found], axis=0, ddof=1)
        wider = {**best.std, name: np.sqrt(best.std[name] ** 2 + scatter)}
        return replace(best, std=wider, seconds=sum(f.seconds for f in found))

    def _of_scales(self, record: Record) -> Followed:
        """With the scales of the form unknown; the first seconds tell where they start, and how far the
        parameter wanders.

        A filter that begins with wide uncertainties becomes surer than its linearisation allows.
        """
        scales, beginning = scales_of_form(), _first(record, POLICY.learnt)
        first = self.known(beginning, scales)
        again = [moved(p, *(float(x[p.name][-1]) for x in (first.value, first.std))) for p in scales]
        size = largest_wandering(lambda size: self._walking(size).known(beginning, again).log_likelihood)
        return self._walking(size).known(record, again)

    def _walking(self, size: float) -> "Task":
        """With a random walk of the parameter of this size or its own, in start deviations in a second."""
        p = self.parameter
        return replace(self, parameter=replace(p, walk=max(p.walk, size * p.std)))

    def along(self, record: Record, shape: Shaped) -> Followed:
        """Run the filter on the outputs alone, with the alignment estimated as well."""
        with self._joint((shape,), ()) as joint:
            return self._followed(joint, record, record.table(()))

    def shaped(self, record: Record) -> Shaped:
        """The shaping filter of the alignment for which the first seconds of a record are likeliest."""
        first = _first(record, LEARNT)
        shapes = [Shaped("y_irr", DEVIATION, f, "y_irr_dot", d) for f, d in SHAPES]
        return max(shapes, key=lambda shape: self.along(first, shape).log_likelihood)

    def _joint(
        self, unknown: tuple[Shaped, ...], inputs: tuple[str, ...], more: Sequence[UnknownParameter] = ()
    ) -> Joint:
        constants, parameters = {"V": V, **self.declared}, [self.parameter, *more]
        return Joint(self.fmu, MEASURED, STATES, parameters, unknown, inputs, constants, DT)

    def _followed(self, joint: Joint, record: Record, u: np.ndarray) -> Followed:
        filter = Ukf(joint, joint.start(), joint.noise, variances(self.noise), DT, adapt=self.adapt)
        return follow(filter, joint, record.t, u, record.table(MEASURED))


def _first(record: Record, length: float) -> Record:
    """The first seconds of a record; length: s."""
    part = record.t < record.t[0] + length
    return Record({name: samples[part] for name, samples in record.columns.items()})


def scales_of_form() -> list[UnknownParameter]:
    """The scales that stand for what the form of the contact leaves open, each from the model's own value."""
    model = model_class("wheelset")
    own = declared(model)
    return [
        UnknownParameter(name, own[name].start or 0.0, (high - low) / 4, bounded((low, high)))
        for name, (low, high) in model.form.items()
    ]


def variances(noise: Mapping[str, float]) -> np.ndarray:
    """Covariance (m, m) of white noise of these standard deviations."""
    return np.diag(np.square([*noise.values()]))
