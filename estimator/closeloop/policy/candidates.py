"""How far an effect or a sensor fault may reach."""

from dataclasses import dataclass

from estimator.limits import limit


@dataclass(frozen=True)
class CandidatePolicy:
    """Limits of the candidates: the sizes that are tried, and how often an effect reads its port."""

    largest_change: float = limit(
        200.0,
        "realistic sizes",
        "bound of a parameter's change",
        "convention: ten times the parameter, since a realistic size is a twentieth of it",
    )
    near_start: float = limit(
        0.2,
        "share of the start value",
        "allowance for calibration, by which the bounds of a parameter's change are wider than its own",
        "convention: data sheets are rarely further off",
    )
    least_inertia: float = limit(
        0.1,
        "share of the start value",
        "of a mass or a moment of inertia that is left at least",
        "derivation: with hardly any left, motion becomes so fast that a simulation takes 1000 times as long",
    )
    longest_delay: float = limit(
        0.1,
        "share of the record",
        "longest delay of a sensor that is looked for by correlation",
        "derivation: the correlation uses as much less of the record",
    )
    readings: int = limit(
        4,
        "readings in a sample",
        "smallest number of readings of a foreign FMU's port while searching",
        "derivation: with fewer, laws that are stiff, as stops are, would be unstable",
    )
