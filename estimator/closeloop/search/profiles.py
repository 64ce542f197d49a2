"""The members of an answer in fine steps of the simulation, with errors from their likelihood profiles."""

from collections.abc import Sequence
from dataclasses import replace

from joblib import Parallel, delayed

from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.likelihood_profile import profiled
from estimator.closeloop.fitting.resolution import in_fine_steps
from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.search.pairs import with_worth
from estimator.closeloop.search.screened import Screened


def finer(
    fitter: Fitter, shown: Screened, new: Sequence[Hypothesis], members: Sequence[Hypothesis]
) -> tuple[Screened, list[Hypothesis]]:
    """The problem in steps that are fine enough for the new members of an answer, and those to be profiled.

    If the steps become finer, these are all members, since hypotheses are compared in the same steps. If they
    stay as they are, so does the screening.
    """
    before = shown.baseline
    problem = in_fine_steps(fitter, new)
    if problem.steps == before.problem.steps:
        return shown, list(new)
    return replace(shown, baseline=before.asked(problem)), list(members)


def with_profiles(
    fitter: Fitter, members: Sequence[Hypothesis], singles: Sequence[Hypothesis]
) -> list[Hypothesis]:
    """Hypotheses with their standard errors taken from the likelihood profile.

    These may leave a doubt whether a pair needs both of its members, which the fits without them answer.
    """
    tasks = (delayed(profiled)(fitter.alone, h) for h in members)
    found = list(Parallel(min(fitter.jobs, len(members)))(tasks))
    pairs, _ = with_worth(fitter, [h for h in found if len(h.candidates) > 1], singles)
    valued = {h.key: h for h in pairs}
    return [valued.get(h.key, h) for h in found]
