"""Numbers, units and formulas in the form in which a page prints them."""

import math
import re
from collections.abc import Sequence

from markupsafe import Markup, escape

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_FUNCTIONS = {"sin", "cos", "tan", "tanh", "atan", "exp", "hypot", "sign", "max", "min", "abs", "sqrt"}
_TOKEN = re.compile(r"(?P<name>[^\W\d]\w*)|\^(?P<power>-?\d+)|(?P<rest>.)", re.DOTALL)
NOTHING = "–"
HELD = "\u00a0"  # a space without a line break


def number(value: float, digits: int = 3) -> str:
    """A number with the given number of significant digits; 0.0447, 12 300, 4.1 × 10⁸."""
    if not math.isfinite(value):
        return NOTHING
    rounded = float(f"{value:.{digits}g}")
    exponent = math.floor(math.log10(abs(rounded))) if rounded else 0
    if not -4 <= exponent < 6:
        return f"{_fixed(rounded / 10.0**exponent, digits - 1)}{HELD}×{HELD}{_power(exponent)}"
    return _fixed(rounded, digits - 1 - exponent if rounded else 0)


def short(value: float, digits: int = 4) -> str:
    """A number as `number` prints it, without zeros at the end of its decimals."""
    text = number(value, digits)
    return text.rstrip("0").rstrip(".") if "." in text and "×" not in text else text


def with_error(value: float, error: float) -> str:
    """A value with as many digits as its standard error justifies: 0.2998 ± 0.0002."""
    if not (math.isfinite(value) and math.isfinite(error) and error > 0):
        return number(value, 4)
    exponent = math.floor(math.log10(max(abs(value), error)))
    scale = 1.0 if -4 <= exponent < 6 else 10.0**exponent
    v, e = value / scale, error / scale
    leading = math.floor(math.log10(e))
    places = -leading + (1 if e < 1.95 * 10.0**leading else 0)
    text = f"{_fixed(round(v, places), places)}{HELD}±{HELD}{_fixed(round(e, places), places)}"
    return text if scale == 1.0 else f"({text}){HELD}×{HELD}{_power(exponent)}"


def interval(low: float, high: float) -> str:
    """An interval, whose ends are told to a tenth of its width's leading digit: 0.9970 to 1.0030.

    A smaller end keeps its first digit, so that its sign is not lost.
    """
    if not (math.isfinite(high - low) and high > low):
        return f"{number(low, 2)} to {number(high, 2)}"
    place = math.floor(math.log10(high - low)) - 1
    digits = {end: math.floor(math.log10(abs(end))) - place + 1 if end else 2 for end in (low, high)}
    return " to ".join(number(end, max(1, n)) for end, n in digits.items())


def percent(share: float) -> str:
    """A share in percent with one decimal; a share that rounds to 1 is 100 %."""
    return f"100{HELD}%" if share >= 0.9995 else f"{_fixed(round(100 * share, 1) + 0.0, 1)}{HELD}%"


def chance(p: float) -> str:
    """A probability as text; what rounds to 0 or 100 % is not said to be certain."""
    if 0.0005 <= p < 0.9995:
        return f"{p:.1%}".replace(".0%", "%").replace("%", " %")
    return "below 0.1 %" if p < 0.5 else "above 99.9 %"


def unit(text: str | None) -> str:
    """A unit of the FMU as it is printed: N.m.s2/rad2 -> N·m·s²/rad²; empty for a pure number."""
    if not text or text == "1" or len(set(text.split("/"))) == 1 < len(text.split("/")):
        return ""
    raised = re.sub(r"(?<=[^\W\d_])-?\d+", lambda power: power[0].translate(_RAISED), text)
    return raised.replace(".", "·")


def quantity(text: str, of: str | None) -> str:
    """A printed number with its unit behind it, if it has one."""
    return f"{text}{HELD}{unit(of)}" if unit(of) else text


def label(text: str, of: str | None) -> str:
    """A quantity with its unit, for axes and heads of tables: "F in N·m"."""
    return f"{text} in {unit(of)}" if unit(of) else text


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of cells as lines of plain text with aligned columns."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]


def capital(text: str) -> str:
    """A text with a capital first letter."""
    return text[:1].upper() + text[1:]


def formula(text: str) -> Markup:
    """Plain mathematics as HTML: "F = -k_3 q^3" with italic names, lowered indices, raised powers."""
    return Markup("").join(_token(found) for found in _TOKEN.finditer(text))


def symbol(name: str) -> Markup:
    """A variable's name as a symbol: F_c with its index lowered."""
    stem, _, index = name.partition("_")
    lowered = Markup("<sub>{}</sub>").format(index) if index else ""
    return Markup("<var>{}</var>{}").format(stem, lowered)


def _token(found: re.Match[str]) -> Markup:
    if found["name"]:
        return escape(found["name"]) if found["name"] in _FUNCTIONS else symbol(found["name"])
    if found["power"]:
        return Markup("<sup>{}</sup>").format(found["power"].replace("-", "−"))
    return escape({"-": "−", "*": "·"}.get(found["rest"], found["rest"]))


def _fixed(value: float, places: int) -> str:
    """Fixed point with a true minus sign, and thin spaces in long numbers."""
    text = f"{value:.{max(places, 0)}f}".replace("-", "−")
    whole, point, decimals = text.partition(".")
    if len(whole.lstrip("−")) > 4:
        whole = re.sub(r"(?<=\d)(?=(\d{3})+$)", "\u202f", whole)
    return whole + point + decimals


def _power(exponent: int) -> str:
    return "10" + str(exponent).translate(_RAISED)
