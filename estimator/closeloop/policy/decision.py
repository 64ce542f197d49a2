"""From fitted hypotheses to a verdict."""

from dataclasses import dataclass

from estimator.closeloop.policy.source import CHALLENGE
from estimator.limits import limit


@dataclass(frozen=True)
class DecisionPolicy:
    """Limits of the decision: from fitted hypotheses to a verdict."""

    telling: float = limit(
        2.0,
        "standard errors",
        "difference in log score from which on one hypothesis is better than another",
        "derivation: 1 in 44 by the normal distribution, on data that no fit has used",
    )
    significant: float = limit(
        4.0,
        "standard errors",
        "distance of an effect's size from zero, below which the effect is not needed",
        "derivation: 1 in 16000 by the normal distribution, so 1 in 100 for the 150 candidates of a record",
    )
    clean: float = limit(
        1.05, "times the noise", "rms of a residual that counts as noise; `chance` is added to it", CHALLENGE
    )
    gap: float = limit(
        0.95,
        "share of the gap to the noise",
        "share of the gap that an answer must close if it leaves more than noise, which must be less than "
        "`signal_share`",
        CHALLENGE,
    )
    most: float = limit(
        0.5,
        "share of the variance",
        "share that one effect must explain of the variance beyond noise if the model form is open; a "
        "residual of which no effect could explain as much is left to the form; what inputs that were held "
        "over a sample must explain of the variance beyond noise; what a free curve beside a law must "
        "explain of what the law leaves beyond noise, so that it is rejected; least probability of an effect "
        "with which a residual that no effect explains is unexplained",
        "derivation: what explains less than it leaves is not what the residual is mainly made of",
    )
    probable: float = limit(
        0.05,
        "probability",
        "probability of the effects of an answer together, below which none is named",
        "convention, as the level of a test; a right pair beside undeclared noise rarely has more than 0.17",
    )
    open_alike: float = limit(
        0.25,
        "share of what the best one leaves beyond noise",
        "a hypothesis that is worse by less cannot be told from the best one if the model form is open",
        CHALLENGE,
    )
    alike: float = limit(
        0.01,
        "share of the sum of squares",
        "a hypothesis that is worse by less cannot be told from the best one: the form may be slightly wrong",
        "agreed assumption: the model's form is right to within small differences",
    )
    unknown: float = limit(
        2.0,
        "log score",
        "gain that each further unknown of a law must bring over the simpler law that is its limit",
        "H. Akaike, IEEE Trans. Automatic Control 19 (1974), 716-723, asks for 1; 2 because laws are many",
    )
    noticed: float = limit(
        40.0,
        "sum of squares, in units of the noise",
        "reduction by a further term that noise alone does not cause",
        "derivation: the largest of 150 chi-squares is below 17 in 99 of 100 records; more than twice that",
    )
    missed: float = limit(
        1e-3,
        "share of what a law explains",
        "further reduction that is possible in the part to identify although the law is right",
        CHALLENGE,
    )

    def told(self, least: float) -> float:
        """The sum of squares by which a hypothesis must exceed the best one's, `least`, to be told from it.

        It holds for a model whose form is right.
        """
        return max(self.noticed, self.alike * least)
