"""Unit strings such as 'kg.m2', 'N.m.s/rad' or 'km/h': what they are in SI, and how to convert.

The radian counts as a dimension of its own, so that turns and angles cannot be mixed up.
"""

import re
import unicodedata
from functools import cache
from tokenize import TokenError
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pint
from numpy.typing import ArrayLike, NDArray

from fmus.errors import BadInput, did_you_mean

# offered when a unit is not known
COMMON = (
    "1 % rad deg rad/s rpm 1/min Hz s m mm m/s km/h m/s2 g_0 kg kg.m2 N kN N.s/m N.m N.m.s/rad V A Ohm degC"
)

# usual in measured files, but not in the grammar of units
SPELLINGS = MappingProxyType(
    {
        "-": "1", "Nm": "N.m", "kNm": "kN.m", "°C": "degC", "U/min": "rpm", "1/min": "rpm", "min-1": "rpm",
        "RPM": "rpm", "r/min": "rpm", "rev/min": "rpm", "sec": "s", "msec": "ms", "Volt": "V", "Ampere": "A",
        "Sekunden": "s", "seconds": "s", "millis": "ms", "milliseconds": "ms", "usec": "us", "Grad": "deg",
        "Grad/s": "deg/s", "degrees": "deg", "dps": "deg/s", "kmh": "km/h", "kph": "km/h", "mps": "m/s",
        "km/hr": "km/h", "kmph": "km/h", "Km/h": "km/h", "KM/H": "km/h", "m/sec": "m/s", "rad/sec": "rad/s",
        "deg/sec": "deg/s", "°/sec": "deg/s", "degrees/s": "deg/s", "N-m": "N.m", "Ncm": "N.cm",
        "Nmm": "N.mm", "mNm": "mN.m", "Nm/rad": "N.m/rad", "Sec": "s", "Sek": "s", "hr": "h", "hours": "h",
        "days": "d", "Rpm": "rpm", "rps": "turn/s", "MPH": "mph", "C": "degC", "ºC": "degC",
    }
)  # fmt: skip

# Units, and the prefixes with which they are in use. pint would take any prefix before any unit, and read the
# German 'Grad' as a gigaradian; it knows far more names, too ('Nm' is a yarn), and works out any power.
_IN_USE = MappingProxyType(
    {
        "% deg ° turn rpm min h d t cd degC g_0 in ft mph lb lbf psi degF": "",
        "m": "n u μ m c d k", "s rad T H": "n u μ m", "g": "n u μ m k M", "A mol": "n u μ m k",
        "K Wb": "u μ m", "Hz": "m k M G", "N": "n u μ m c d da k M G", "Pa": "u μ m h k M G",
        "J W": "n u μ m k M G", "V S": "n u μ m k M", "Ohm Ω": "u μ m k M G", "F": "p n u μ m",
        "bar": "u μ m d k", "L l": "u μ m c d h",
    }
)  # fmt: skip
UNITS = tuple(p + u for units, some in _IN_USE.items() for p in ("", *some.split()) for u in units.split())
_NAME = "|".join(map(re.escape, UNITS))
_POWER = r"(?:\*\*|\^)-?[0-9]"
_GRAMMAR = re.compile(rf"(?:[()*/]|(?<!\w)(?:1|(?:{_NAME})(?:{_POWER})?)(?!\w))+")
_SIGNS = str.maketrans({"·": ".", "⋅": ".", "−": "-", "∕": "/"})  # that look alike

# pint's base units by the attribute that FMI gives them in <BaseUnit>
_FMI_BASE = MappingProxyType(
    {
        "kilogram": "kg",
        "meter": "m",
        "second": "s",
        "ampere": "A",
        "kelvin": "K",
        "mole": "mol",
        "candela": "cd",
        "radian": "rad",
    }
)
SAME = (1.0, 0.0)  # factor and offset of a number that is not converted
LONGEST = 100  # characters of a unit
_NOT_PARSED = (pint.PintError, TokenError, ValueError, TypeError, AssertionError, ArithmeticError)


class BaseUnit(NamedTuple):
    """A unit in SI: `exponents` by FMI's names (kg m s A K mol cd rad), value in SI = factor * v + offset."""

    exponents: dict[str, int]
    factor: float
    offset: float


@cache
def _registry() -> pint.UnitRegistry[float]:
    """The one registry; made at first use because reading its definitions takes 0.1 s."""
    registry: pint.UnitRegistry[float] = pint.UnitRegistry()
    registry.define("@alias ohm = Ohm")
    return registry


def _pint_text(unit: str) -> str:
    """The unit in pint's grammar: 'kg.m2' -> 'kg*m**2', 's-1' -> 's**-1'."""
    text = re.sub(r"\s*([./*^])\s*", r"\1", plain(unit))
    return re.sub(r"([^\W\d_])(-?[0-9]+)", r"\1**\2", text.replace(".", "*"))


def plain(unit: str) -> str:
    """The unit with one character for those that look alike: digits, signs of micro, dots, minuses."""
    return unicodedata.normalize("NFKC", unit.strip()).translate(_SIGNS)


def base_exponents(unit: str) -> BaseUnit:
    """SI base exponents (only those that are not 0), factor and offset of a unit; BadInput if unknown."""
    if len(unit) > LONGEST:
        raise BadInput(f"unit '{unit[:20]}...' has {len(unit)} characters; give one that is known")
    text = _pint_text(unit)
    try:
        if not _GRAMMAR.fullmatch(text):
            raise ValueError(text)
        registry = _registry()
        parsed = registry.parse_units(text)
        zero, one = (registry.Quantity(v, parsed).to_base_units() for v in (0.0, 1.0))
        exponents = {_FMI_BASE[name]: int(power.real) for name, power in one.unit_items() if power}
    except (*_NOT_PARSED, KeyError) as error:
        meant = did_you_mean(SPELLINGS.get(unit, unit), {*COMMON.split(), *SPELLINGS.values()})
        raise BadInput(f"unit '{unit}' is not known; {meant}") from error
    offset = float(zero.magnitude)
    return BaseUnit(exponents, float(one.magnitude) - offset, offset)


def conversion(unit: str, target_unit: str, where: str) -> tuple[float, float]:
    """Factor and offset with value in `target_unit` = factor * value in `unit` + offset.

    `where` (file and key) begins the message of the BadInput for unknown or incompatible units.
    The same name on both sides passes even if it is nobody's unit, as 'ticks'.
    """
    if unit == target_unit:
        return SAME
    try:
        source = base_exponents(unit)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from error
    try:
        target = base_exponents(target_unit)
    except BadInput as error:
        raise BadInput(
            f"{where}: unit '{unit}' cannot be compared with the FMU's unit '{target_unit}', which is not "
            f'known; convert the column and write unit = "{target_unit}"'
        ) from error
    clash = _clash(unit, source, target_unit, target)
    if clash:
        raise BadInput(f"{where}: unit '{unit}' does not fit '{target_unit}'; {clash}")
    return source.factor / target.factor, (source.offset - target.offset) / target.factor


def another_kind(unit: str, other: str) -> bool:
    """Whether two units are known and measure different things; a radian, often left out, does not count."""
    try:
        return _kind(base_exponents(unit)) != _kind(base_exponents(other))
    except BadInput:
        return False


def model_unit(stated: str | None, declared: str | None, variable: str, where: str) -> str | None:
    """The unit of an FMU's variable: as the FMU states it, else as the user declares it, else None.

    `where` (file and key) begins the message of the BadInput for a declared unit that is not known or that
    differs from the stated one.
    """
    if declared is None:
        return stated
    try:
        base_exponents(declared)
        alike = stated is None or conversion(declared, stated, where) == SAME
    except BadInput as error:
        said = str(error).removeprefix(f"{where}: ")
        raise BadInput(f'{where} model_unit = "{declared}": {said}') from error
    if not alike:
        raise BadInput(
            f"{where} model_unit = \"{declared}\", but {variable} is in '{stated}', as the FMU states; "
            "leave model_unit out"
        )
    return stated or declared


def column_conversion(unit: str, target: str | None, variable: str, where: str) -> tuple[float, float]:
    """Factor and offset from a column's unit to that of an FMU's variable.

    Raises BadInput where the units do not fit, and where that of the variable is said by nobody.
    """
    if target is not None:
        return conversion(unit, target, where)
    try:
        base_exponents(unit)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from error
    raise BadInput(
        f"{where}: the column is in '{unit}', but the FMU states no unit for {variable} to convert it to; "
        'write model_unit = "..." beside the column, the unit of the variable in the FMU'
    )


def to_si(values: ArrayLike, unit: str, target_unit: str, where: str) -> NDArray[np.float64]:
    """Values in `unit` -> values in `target_unit`, the unit of the FMU's variable (SI for our own).

    values: (n,) or any shape, kept; `where` begins the message of the BadInput for units that do not fit.
    """
    factor, offset = conversion(unit, target_unit, where)
    return np.asarray(values, dtype=np.float64) * factor + offset


def _kind(base: BaseUnit) -> dict[str, int]:
    return {name: power for name, power in base.exponents.items() if name != "rad"}


def _clash(unit: str, source: BaseUnit, target_unit: str, target: BaseUnit) -> str:
    """Why the two cannot be converted, with the way out; empty if they can."""
    rads = [b.exponents.get("rad", 0) for b in (source, target)]
    if _kind(source) != _kind(target):
        hint = "; an acceleration in g is 'g_0'" if unit == "g" else ""
        return f"give the column in a unit of the same kind{hint}"
    if rads[0] == rads[1]:
        return ""
    # without rad is sloppy but clear ("1/s" for "rad/s"), unless it may count turns (Hz, 1/min)
    if 0 not in rads:
        return "the radian stands on the other side of the fraction; write the unit the column really has"
    bare, base, other = (unit, source, target_unit) if rads[0] == 0 else (target_unit, target, unit)
    counts = "Hz" in bare or (set(base.exponents) == {"s"} and base.factor != 1.0)
    if counts or "rpm" in other or "turn" in other:
        return "a turn is 2 pi rad: write 'rpm' or 'rad/s' if that is meant, or multiply the column by 2 pi"
    return ""
