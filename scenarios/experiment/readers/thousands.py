"""Numbers whose sign may group thousands: 1.000 is one, or a thousand."""

from pathlib import Path

import numpy as np
import pandas as pd

from fmus.errors import BadInput
from scenarios.experiment.readers.layout import THOUSANDS, Layout

FAR = 1000**0.5  # times: a whole number larger than its neighbour by more is nearer to that in thousands


def check_decimal(file: Path, layout: Layout, columns: pd.DataFrame) -> None:
    """Raise BadInput if the decimal sign of a file may be that of thousands; columns: numbers as text.

    Numbers of one column are written in one way: each with the same decimals, or none with a zero at its end.
    Where some have no sign, and all others look like grouped thousands, it is neither if one of these ends
    with a zero. If none does, neighbours tell: after 999, 1.003 is rather a thousand and three. One number
    in the file with a sign that must be that of decimals settles it.
    """
    found = None
    for name in columns:
        cells = columns[name].str.strip()
        signed = cells.str.contains(layout.decimal, regex=False, na=False)
        grouped = cells.str.fullmatch(THOUSANDS, na=False)
        if (signed & ~grouped).any():
            return
        if found is None and _may_be_thousands(cells, signed):
            found = str(name), int(signed.to_numpy().argmax())
    if found is not None:
        name, row = found
        held, sign = columns[name].iloc[row].strip(), layout.decimal
        raise BadInput(
            f"{file} line {layout.first + row}: column '{name}' holds '{held}' and numbers without '{sign}', "
            "which may group thousands or begin decimals; say which in [data], "
            f'thousands = "{sign}" or decimal = "{sign}"'
        )


def _may_be_thousands(cells: "pd.Series[str]", signed: "pd.Series[bool]") -> bool:
    """Whether numbers with a sign, all like grouped thousands, go on those without one."""
    whole = cells[~signed].dropna()
    if not signed.any() or whole.empty or not whole.str.fullmatch(r"[+-]?\d{1,3}").all():
        return False
    if cells[signed].str.endswith("0").any():
        return True
    number = pd.to_numeric(cells.str.replace(",", ".")).abs().to_numpy()
    one, other = number[:-1], number[1:]
    after, before = (signed.to_numpy()[i] for i in (slice(1, None), slice(None, -1)))
    edges = [*(one / other)[after & ~before], *(other / one)[before & ~after]]  # of whole to signed ones
    return bool(edges) and bool(np.nanmedian(edges) > FAR)
