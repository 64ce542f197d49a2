"""The limits of a fleet's statistics that can change what is said, in one object."""

from dataclasses import dataclass

from estimator.limits import Limits, limit


@dataclass(frozen=True)
class FleetPolicy(Limits):
    """Limits of scatter, courses over mileage, deviation and pooling."""

    confidence: float = limit(0.95, "probability", "of all intervals", "convention")
    fewest_records: int = limit(
        4,
        "records",
        "fewest records of a vehicle whose course over mileage is tested",
        "derivation: a line or a change leaves two degrees of freedom then",
    )
    fewest_beside: int = limit(
        2,
        "records",
        "fewest records on either side of a change",
        "derivation: one record that is odd is no change",
    )
    informed: float = limit(
        0.9,
        "share of the standard deviation before the record",
        "standard error of an estimate from which on its record says nothing on it",
        "agreed with `estimate`, which says of such a quantity that the record contains too little on it",
    )
    change_ratio: float = limit(
        7.35,
        "twice a log likelihood",
        "by how much the likelihood of a place of change may be below the largest, within the interval",
        "B. E. Hansen, Econometrica 68 (2000), 575-603: -2 ln(1 - sqrt(0.95))",
    )
    fewest_vehicles: int = limit(
        4,
        "vehicles",
        "fewest vehicles of a class of which one can deviate from the others",
        "derivation: of three, the one that is odd moves the median by as much as the others scatter",
    )
    middle: float = limit(
        0.5,
        "share of the vehicles",
        "vehicles whose sums of squares are as probable as they should be, by which a scatter is found",
        "convention: the median, which odd vehicles do not move while they are fewer than half",
    )
    unequal: float = limit(
        0.75,
        "share of the vehicles",
        "quantile by which it is found how much the scatter of the vehicles differs",
        "convention: the upper quartile; vehicles that drift or change stay above it while they are few",
    )
    efficiency: float = limit(
        0.37,
        "share of the degrees of freedom",
        "degrees of freedom that count where a scatter is found by a median",
        "P. J. Rousseeuw and C. Croux, J. Am. Stat. Assoc. 88 (1993), 1273-1283, against a mean of squares",
    )
    least_freedom: float = limit(
        1.0,
        "degrees of freedom",
        "fewest that the class lends to a vehicle's own scatter",
        "convention: with fewer the class says next to nothing on its vehicles",
    )
    counted: float = limit(
        3.0,
        "times the expected squares",
        "up to which a vehicle's squares count where the correlation of successive records is found",
        "derivation: one sound vehicle in a hundred is beyond it, and one that changes counts as three",
    )
    most_correlated: float = limit(
        0.95,
        "correlation",
        "largest correlation of successive records that is reckoned with",
        "convention: of 40 records one is left then; more cannot be told from a drift",
    )


POLICY = FleetPolicy()
