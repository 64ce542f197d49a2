"""Calibration of the declared parameters, with the steps and the inputs with which the FMU is nearest."""

from estimator.closeloop.checkpoints import Stages
from estimator.closeloop.fitting.calibrate import calibrate, explains_most, without_input_noise
from estimator.closeloop.fitting.resolution import in_long_steps, in_settled_steps, long_steps_hold
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.progress import Progress
from estimator.closeloop.question.problem import Problem
from estimator.noise import Noise

Calibrated = tuple[Problem, Hypothesis, Hypothesis, Noise]  # the problem, and what `calibrate` finds


def in_its_steps(problem: Problem, tell: Progress, stages: Stages) -> Calibrated:
    """The problem and what `calibrate` finds, in the longest steps if these hold."""
    long = in_long_steps(problem)
    found = _with_its_inputs(long, tell, stages)
    there, _, base, noise = found
    if long is problem or long_steps_hold(there, base, noise):
        return _settled(found, tell, stages)
    tell("steps", "calibrating in shorter steps")
    return _settled(_with_its_inputs(problem, tell, stages.under("held")), tell, stages)


def _with_its_inputs(problem: Problem, tell: Progress, stages: Stages) -> Calibrated:
    """The same in the steps of a problem, with smoothed inputs if they have noise."""
    found = stages.done("calibrated", lambda: calibrate(problem))
    other = without_input_noise(problem, found[1])
    if other is None:
        return problem, *found
    tell("inputs", "calibrating with smoothed inputs")
    return other, *stages.done("smoothed", lambda: calibrate(other))


def _settled(found: Calibrated, tell: Progress, stages: Stages) -> Calibrated:
    """The same with outputs that see the inputs of their sample, unless these were held over it."""
    problem, _, base, noise = found
    other = in_settled_steps(problem, base.theta, noise.weighting)
    if other is None:
        return found
    tell("steps", "calibrating with outputs that see the inputs of their sample")
    again = stages.done("settled", lambda: calibrate(other))
    return found if explains_most(problem, base, again[1]) else (other, *again)
