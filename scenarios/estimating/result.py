"""The result of estimate, as it is written to result.json and estimate.csv."""

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from estimator.filters.consistency import (
    NIS,
    WHITENESS,
    Check,
    mean_band,
    share_within,
    whiteness,
)
from estimator.filters.history import History
from estimator.filters.identifiability import Identifiability
from estimator.filters.policy import POLICY as OF_FILTER
from estimator.filters.sensor_noise import SensorNoise
from estimator.filters.system import Joint
from estimator.record import Array
from fmus.aside import blocks, let_go
from scenarios.drawing.typography import quantity, with_error
from scenarios.estimating.alarms import Raised
from scenarios.estimating.policy import POLICY
from scenarios.estimating.setup import BAND, Bands
from scenarios.shown import Shown, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class EstimateResult(Shown):
    """The result of estimate.

    estimated: by name, the kind, value, standard error, 95 % band and further properties of each quantity.
    innovations: by output, the noise, the rms over its expected value (1 if model and noise are right), the
    largest correlation, the p value of whiteness, and the share of measurements rejected by the gate.
    checks: the consistency tests of the filter; consistent: whether it passes all of them.
    sensor_noise: by output, the standard deviation of its noise, the share of its variance that is correlated
    and over what time, s, with the 95 % bands of what was estimated of it.
    input_noise: standard deviation of the white noise of each input that has any, at a step of the filter.
    rms_error: errors of the estimates, only if true values were given.
    """

    experiment: str
    filter: str
    estimated: dict[str, dict[str, Any]]
    innovations: dict[str, dict[str, float | None]]
    nis: dict[str, float | None]
    checks: tuple[Check, ...]
    consistent: bool
    log_likelihood: float
    identifiability: dict[str, Any]
    alarms: list[Raised]
    sensor_noise: dict[str, dict[str, Any]]
    input_noise: dict[str, float]
    process_noise: dict[str, float]
    process_noise_share: float | None
    access: str
    refused: dict[str, str]
    samples: int
    seconds_of_record: float
    wall_seconds: float
    diverged: bool
    reason: str
    rms_error: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    limits: dict[str, float] = field(default_factory=lambda: {**OF_FILTER.values, **POLICY.values})

    @property
    def doubt(self) -> str:
        """A sentence on failed consistency tests and the standard errors; empty if all tests pass."""
        return "" if self.consistent or self.diverged else doubt(self.checks)

    def lines(self) -> list[str]:
        """See Shown.lines."""
        return [*self._lines()]

    def _lines(self) -> Iterator[str]:
        for name, found in self.estimated.items():
            if found["kind"] == "noise":
                continue
            spread = found["std_error"]
            unit = found["unit"] if found["unit"] not in (None, "1") else ""
            bound = f" (at its {found['at_bound']} bound)" if "at_bound" in found else ""
            yield f"{name} = {found['value']:.5g} ± {spread:.2g} {unit}".rstrip() + bound
        if self.doubt:
            yield self.doubt
        for alarm in self.alarms:
            end = "to the end" if alarm.end is None else f"to {alarm.end:g} s"
            likely = f"probability {alarm.probability:.3f}"
            yield f"alarm: {alarm.name} {alarm.limit} from {alarm.begin:g} s {end}, {likely}"
        if self.diverged:
            yield f"diverged: {self.reason}"

    def to_frame(self) -> pd.DataFrame:
        """Each estimated quantity with its value, standard error and 95 % band, in the FMU's units."""
        columns = ["kind", "value", "std_error", "unit", "low_95", "high_95", "consistent"]
        rows = {
            name: [e["kind"], e["value"], e["std_error"], e["unit"], *e["band_95"], self.consistent]
            for name, e in self.estimated.items()
        }
        return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("quantity")

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """The standard error of each quantity, as a share of its value."""
        table = self.to_frame()
        drawn = axes_or_new(ax)
        drawn.barh(table.index.to_list(), (table["std_error"] / table["value"].abs()).to_numpy())
        word = "" if self.consistent else ", not consistent with the record"
        drawn.set(xlabel="standard error over value", xscale="log", title=f"{self.experiment}{word}")
        return drawn

    def write(self, path: Path) -> None:
        """Write the result as JSON."""
        path.write_text(json.dumps(asdict(self), indent=1, allow_nan=False), encoding="utf-8")


def passes(checks: tuple[Check, ...]) -> bool:
    """Whether the NIS could be tested, and all tests are passed."""
    return any(c.check == NIS for c in checks) and all(c.passed for c in checks)


def doubt(checks: tuple[Check, ...]) -> str:
    """The failed tests with their values and expected ranges, and what follows for the standard errors."""
    nis = next((c for c in checks if c.check == NIS), None)
    if nis is None:
        return "not tested, because the record has too few innovations; the standard error may be wrong"
    said, low, high = [], *nis.limit
    if not nis.passed:
        said.append(f"NIS {nis.value:.4g}, expected {low:.4g} to {high:.4g}")
    remembering = [c for c in checks if c is not nis and not c.passed]
    if remembering:
        names = ", ".join(c.check.removeprefix(WHITENESS) for c in remembering)
        least = min(remembering, key=lambda c: c.value)
        said.append(
            f"innovations of {names} correlated in time (p = {least.value:.2g}, "
            f"expected above {least.limit[0]:.2g})"
        )
    wrong = "is too small"
    if nis.value < low:
        wrong = "cannot be relied on" if remembering else "is too large"
    return f"not consistent with the record: {'; '.join(said)}; so the standard error {wrong}"


def estimated(
    joint: Joint, h: History, informed: dict[str, bool], bounds: dict[str, str], form: tuple[str, ...] = ()
) -> dict[str, dict[str, Any]]:
    """The last value of each quantity in the FMU's units; bounds: side of the bound that it lies at.

    form: names of the parameters that stand for what the form of the model leaves open. "prior": mean and
    standard deviation of a constant parameter before the record, which its estimate still contains.
    """
    if not len(h.t):
        return {}
    kinds = ["state"] * len(joint.states)
    kinds += ["form" if p.name in form else "parameter" for p in joint.parameters]
    kinds += ["input"] * (len(h.names) - len(kinds) - len(joint.noises))
    kinds += ["noise"] * len(joint.noises)
    value, std = joint.values(h.x[-1:], h.std[-1:])
    low, high = (joint.values(h.x[-1:] + s * BAND * h.std[-1:], h.std[-1:])[0][0] for s in (-1, 1))
    variables = joint.archive.description.variables
    unit = {n: v.unit for n, v in variables.items()}
    unit |= {name: unit[of] for name, of in joint.noises.items()}
    rates = [(w.states[0], rate) for w in joint.unknown for rate in w.states[1:] if rate not in unit]
    unit |= {rate: f"{of}/s" for name, rate in rates if (of := unit.get(name))}
    believed = {p.name: [p.start, p.std] for p in joint.parameters if not p.walk and p.name not in form}
    return {
        name: {
            "kind": kind,
            "unit": unit.get(name),
            "value": float(value[0, i]),
            "std_error": float(std[0, i]),
            "band_95": [float(low[i]), float(high[i])],
            **({"prior": believed[name]} if name in believed else {}),
            **({"informed_by_data": informed[name]} if name in informed else {}),
            **({"at_bound": bounds[name]} if name in bounds else {}),
        }
        for i, (name, kind) in enumerate(zip(h.names, kinds, strict=True))
    }


def innovations(h: History, outputs: tuple[str, ...], noise: Array) -> dict[str, dict[str, float | None]]:
    """How well the filter predicted each output, where its gate accepted the measurement."""
    found, accepted = {}, h.accepted
    for j, name in enumerate(outputs):
        e, measured = accepted[:, j], int(np.isfinite(h.innovation[:, j]).sum())
        seen = e[np.isfinite(e)]
        white = whiteness(e)
        found[name] = {
            "noise": finite(float(noise[j])),
            "rms_over_expected": finite(float(np.sqrt(np.mean(seen**2))) if len(seen) else np.nan),
            "mean_over_expected": finite(float(np.mean(seen)) if len(seen) else np.nan),
            "largest_correlation": finite(white.largest),
            "white_below": finite(white.limit),
            "p_white": finite(white.p_value),
            "gated_share": finite(float(h.gated[:, j].sum()) / measured if measured else np.nan),
        }
    return found


def sensor_noise(sensors: Sequence[SensorNoise], bands: Bands) -> dict[str, dict[str, Any]]:
    """The noise of each output that the filter assumed; bands: of what was estimated of it, by output."""
    return {
        n.output: {
            "std": n.std, "share": n.share, "time": n.time if n.share else None,
            "band_95": {what: list(band) for what, band in bands.get(n.output, {}).items()},
        }
        for n in sensors
    }  # fmt: skip


def nis(h: History) -> dict[str, float | None]:
    """Normalised innovations squared, with their 95 % band."""
    used = h.freedom > 0
    band = mean_band(h.nis[used], h.freedom[used])
    share = share_within(h.nis[used], h.freedom[used])
    freedom = float(np.mean(h.freedom[used])) if used.any() else np.nan
    figures = {
        "mean": band.value, "low_95": band.low, "high_95": band.high, "freedom": freedom,
        "share_within_95": share,
    }  # fmt: skip
    return {name: finite(value) for name, value in figures.items()}


def identified(before: Identifiability | None, after: Identifiability | None) -> dict[str, Any]:
    """How much the record tells about each unknown parameter and input, before and after filtering."""
    found: dict[str, Any] = {}
    for when, i in (("before", before), ("after", after)):
        if i is not None:
            found[when] = {
                "deviation_left": dict(zip(i.names, map(float, i.left), strict=True)),
                "correlation": [[round(float(c), 4) for c in row] for row in i.correlation],
                "alike": [[a, b, round(c, 4)] for a, b, c in i.alike],
            }
    return found


def finite(value: float) -> float | None:
    """A number that JSON can hold."""
    return value if np.isfinite(value) else None


def write_csv(path: Path, names: tuple[str, ...], t: Array, value: Array, std: Array) -> None:
    """Write the columns time, then NAME and NAME_std of each quantity."""
    header = ["time", *(c for n in names for c in (n, f"{n}_std"))]
    with path.open("w", encoding="utf-8") as stream:
        csv.writer(stream, lineterminator="\n").writerow(header)  # names of an FMU may hold commas
        for rows in blocks(len(t), 8 * (1 + 2 * len(names))):
            both = np.stack([value[rows], std[rows]], axis=2).reshape(-1, 2 * len(names))
            np.savetxt(stream, np.column_stack([t[rows], both]), fmt="%.9g", delimiter=",")
            let_go()


def main_values(estimated: Mapping[str, Mapping[str, Any]]) -> str:
    """The estimated parameters, or all quantities if there are none, with errors and a remark at a bound."""
    wanted = {n: e for n, e in estimated.items() if e["kind"] == "parameter"}
    wanted = wanted or {n: e for n, e in estimated.items() if e["kind"] != "noise"}
    said = [_headed(n, e) for n, e in wanted.items()]
    return ", ".join(said[:4]) + (", …" if len(said) > 4 else "")


def _headed(name: str, e: Mapping[str, Any]) -> str:
    bound = f" (at its {e['at_bound']} bound)" if "at_bound" in e else ""
    return f"{name} = {quantity(with_error(e['value'], e['std_error']), e['unit'])}{bound}"
