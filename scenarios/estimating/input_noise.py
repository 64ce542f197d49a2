"""White noise of the recorded inputs, as their spectra show it."""

from math import sqrt

from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.input_noise import white_part
from estimator.filters import filters
from estimator.filters.unknown_input import NoisyInput
from estimator.record import Record
from scenarios.estimating.sensors import likelihood_says
from scenarios.experiment.estimated import Options


def errors_of_inputs(o: Options, record: Record, every: int) -> tuple[NoisyInput, ...]:
    """The errors that the inputs of a record may have; every: number of samples in a step of the filter.

    None where the likelihood cannot tell whether they have them, and where the filter takes no such errors.
    The mean of an input over a step has the error of `every` samples.
    """
    if not likelihood_says(o) or not filters()[o.filter].noises:
        return ()
    u = record.runs[0].u
    found = ((name, white_part(u[:, j], DEFAULT.inputs)) for j, name in enumerate(record.inputs))
    return tuple(NoisyInput(name, std / sqrt(every)) for name, std in found if std)
