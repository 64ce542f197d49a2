"""Physical quantities by the words that people name channels and variables with."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from fmus.errors import BadInput
from fmus.units import base_exponents, conversion
from scenarios.experiment.readers.header import spelled
from scenarios.experiment.readers.units import ALSO


@dataclass(frozen=True)
class Quantity:
    """A quantity: its unit in SI, and the words for it in lower case, symbols among them."""

    name: str
    unit: str
    words: tuple[str, ...]


QUANTITIES = (
    Quantity("voltage", "V", ("u", "voltage", "volt", "spannung", "u_a", "v_in", "vin")),
    Quantity("current", "A", ("i", "current", "strom", "amp", "i_a", "amperage")),
    Quantity("speed of rotation", "rad/s", ("omega", "w", "n", "speed", "rpm", "drehzahl", "spin")),
    Quantity("velocity", "m/s", ("v", "velocity", "speed", "geschwindigkeit", "vel", "dot")),
    Quantity("torque", "N.m", ("t", "m", "torque", "moment", "drehmoment", "tau", "trq")),
    Quantity("force", "N", ("f", "force", "kraft")),
    Quantity("angle", "rad", ("theta", "phi", "angle", "winkel", "psi", "alpha", "position")),
    Quantity("displacement", "m", ("q", "x", "y", "z", "s", "position", "pos", "displacement", "weg")),
    Quantity("acceleration", "m/s2", ("a", "acc", "acceleration", "beschleunigung", "ddot")),
    Quantity("temperature", "degC", ("temperature", "temp", "temperatur")),
    Quantity("pressure", "Pa", ("p", "pressure", "druck")),
)  # fmt: skip
_BRACKET = re.compile(r"[\[(].*?[\])]")
_WORDS_IN_BRACKETS = re.compile(r"[\[(][^\])]*[^\d\s,\])][^\])]*[\])]")
_SEPARATED = re.compile(r"[\W_]+")
_CAPITAL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_SPLIT = re.compile(r"[^A-Za-z0-9]+|(?<=[a-z])(?=[A-Z])")


def words_of(name: str) -> list[str]:
    """The words of a name in lower case, without a unit in brackets and without digits at their end."""
    return [word.rstrip("0123456789") or word for word in numbered_words_of(name)]


def numbered_words_of(name: str) -> list[str]:
    """The same with these digits."""
    return [word.lower() for word in _SPLIT.split(_BRACKET.sub(" ", name)) if word]


def numbers_of(name: str) -> list[int]:
    """The numbers in a name, also an index in brackets, but none of a unit in brackets."""
    return [int(number) for number in re.findall(r"\d+", _WORDS_IN_BRACKETS.sub(" ", name))]


def quantities_of(name: str, description: str = "") -> list[Quantity]:
    """The quantities that a name can mean, likeliest first: by its first word, then by the others."""
    words = [*words_of(name), *(w for w in words_of(description) if len(w) > 2)]
    found = [q for word in words for q in QUANTITIES if word in q.words]
    return list(dict.fromkeys(found))


def alike(unit: str, other: str) -> bool:
    """Whether two units can be converted into each other."""
    try:
        conversion(unit, other, "")
    except BadInput:
        return False
    return True


def meant_by(unit: str | None, fitting: Sequence[str]) -> str | None:
    """The unit that a word of a file means, as g of an acceleration; None if it is not known.

    fitting: units, into one of which it should convert.
    """
    also = ALSO.get(unit or "")
    if also and any(alike(also, other) for other in fitting):
        return also
    return unit if known(unit) else None


def unit_in_name(name: str, fitting: Sequence[str]) -> str | None:
    """The unit that ends a name, as in v_kmh or speedRpm, if it can be converted into one of these units.

    The last two words may be the unit together, as in v_km_h, acc_m_s2 and torque_N_m. Capitals that make no
    unit are read as small letters, as in SPEED_KMH. The word 'in' at the end means that something goes in,
    and no inches.
    """
    words = [word for word in _SEPARATED.split(_BRACKET.sub(" ", name)) if word]
    both = [sign.join(words[-2:]) for sign in "/." if len(words) > 2 and words[-2] != "in"]
    single = [word[i:] for word in words[-1:] for i in (0, *(m.start() for m in _CAPITAL.finditer(word)))]
    ends = [spelled(w) for end in (*both, *single) for w in (end, end[:1].lower() + end[1:], end.lower())]
    units = [u for end in ends if not end.isdigit() and end != "in" for u in (end, ALSO.get(end, end))]
    return next((u for u in units if any(alike(u, other) for other in fitting)), None)


def known(unit: str | None) -> bool:
    """Whether a unit is stated and known."""
    if not unit:
        return False
    try:
        base_exponents(unit)
    except BadInput:
        return False
    return True


def likely_unit(name: str, description: str, column_unit: str | None) -> str | None:
    """The SI unit that a variable without one probably has; None if its name and its column say nothing."""
    meant = quantities_of(name, description)
    if column_unit and known(column_unit):
        fitting = [q.unit for q in (*meant, *QUANTITIES) if alike(column_unit, q.unit)]
        return fitting[0] if fitting else column_unit
    return meant[0].unit if meant else None


def shared_words(one: Sequence[str], other: Sequence[str]) -> int:
    """How many words of at least three letters two lists have in common; a beginning of four is enough."""
    words = {w for w in one if len(w) > 2}
    return sum(
        any(w == v or (min(len(w), len(v)) > 3 and (w.startswith(v) or v.startswith(w))) for w in words)
        for v in set(other)
    )
