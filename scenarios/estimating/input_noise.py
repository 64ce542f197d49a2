"""White noise of the recorded inputs, as it is declared or as their spectra show it."""

from math import sqrt

from estimator.closeloop.policy import DEFAULT
from estimator.closeloop.question.input_noise import white_part
from estimator.filters import filters
from estimator.filters.unknown_input import NoisyInput
from estimator.record import Record
from scenarios.estimating.sensors import likelihood_says
from scenarios.experiment.estimated import Options


def declared_errors(record: Record, every: int) -> tuple[NoisyInput, ...]:
    """The errors of the inputs whose noise is declared; every: number of samples in a step of the filter.

    The mean of an input over a step has the error of `every` samples.
    """
    return tuple(NoisyInput(name, std / sqrt(every)) for name, std in record.input_std.items())


def possible_errors(o: Options, record: Record, every: int) -> tuple[NoisyInput, ...]:
    """The errors that the spectra of the other inputs show, which may be their excitation as well.

    None where the likelihood cannot tell, and where the filter takes no such errors.
    """
    if not likelihood_says(o) or not filters()[o.filter].noises:
        return ()
    u = record.runs[0].u
    others = ((j, name) for j, name in enumerate(record.inputs) if name not in record.input_std)
    found = ((name, white_part(u[:, j], DEFAULT.inputs)) for j, name in others)
    return tuple(NoisyInput(name, std / sqrt(every)) for name, std in found if std)
