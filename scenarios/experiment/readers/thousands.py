"""Numbers whose sign may group thousands: 1.000 is one, or a thousand."""

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from fmus.errors import BadInput
from scenarios.experiment.readers.layout import THOUSANDS, Layout

WHOLE = 4  # different whole numbers; each has a chance of 1/4 not to be a half or quarter, by steps of 0.125
FAR = 1000**0.5  # times: whole numbers larger than the others by more are nearer to these in thousands


def remarks_on_thousands(file: Path, layout: Layout, columns: pd.DataFrame) -> tuple[str, ...]:
    """Remarks on columns whose decimals may be thousands; columns: of numbers, as text.

    Numbers of one column are written in one way: each with the same decimals, or none with a zero at its end.
    Raises BadInput for a column in which some numbers have no sign and all others look like grouped
    thousands, if one of these ends with a zero, if many are whole and none is a half or quarter, or if the
    whole ones are so large that the others go on from them as thousands. What is left is read as decimals,
    with a remark. One number in the file with a sign that must be that of decimals settles it.
    """
    text = {str(name): columns[name].dropna().str.strip() for name in columns}
    signed = {name: cells.str.contains(layout.decimal, regex=False) for name, cells in text.items()}
    if any((signed[name] & ~text[name].str.fullmatch(THOUSANDS)).any() for name in text):
        return ()
    return tuple(_remarks(file, layout, text, signed))


def _remarks(
    file: Path, layout: Layout, text: dict[str, "pd.Series[str]"], signed: dict[str, "pd.Series[bool]"]
) -> Iterator[str]:
    sign = layout.decimal
    for name, cells in text.items():
        with_sign, whole = cells[signed[name]], cells[~signed[name]]
        if with_sign.empty or not whole.str.fullmatch(r"[+-]?\d{1,3}").all():
            continue
        if not whole.empty and _go_on(whole, with_sign):
            line = layout.first + int(with_sign.index[0])
            raise BadInput(
                f"{file} line {line}: column '{name}' holds '{with_sign.iloc[0]}' and numbers without "
                f"'{sign}', which may group thousands or begin decimals; say which in [data], "
                f'thousands = "{sign}" or decimal = "{sign}"'
            )
        held = f"column '{name}' has three digits behind each '{sign}', as in {with_sign.iloc[0]}"
        yield f'{file.name}: {held}; they are read as decimals, unless [data] has thousands = "{sign}"'


def _go_on(whole: "pd.Series[str]", with_sign: "pd.Series[str]") -> bool:
    """Whether numbers with a sign, all like grouped thousands, rather go on whole ones of their column."""
    if with_sign.str.endswith("0").any() or whole.nunique() >= WHOLE:
        return True
    usual, other = (pd.to_numeric(x.str.replace(",", ".")).abs().median() for x in (whole, with_sign))
    return bool(usual > FAR * other)
