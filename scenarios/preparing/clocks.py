"""How far the clocks of a record's files are apart: by their dates, or by the FMU simulated beside them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import floor, log10

import numpy as np
from scipy.signal import correlate

from estimator.record import Array
from fmus.export.provenance import isolation_of
from fmus.host.apart.isolation import FmuEnded, Isolation
from fmus.host.description import FmuVariable
from fmus.host.fmu import Fmu, FmuError
from fmus.units import column_conversion
from scenarios.experiment.sampling import at_times, step_of
from scenarios.preparing.draft import Clock, Draft, Signal
from scenarios.preparing.quantities import alike, known, quantities_of, words_of
from scenarios.preparing.survey import Channel, Raster

OVERLAP = 0.3  # of the shorter signal must overlap at a lag that is compared
LEAST = 0.7  # correlation from which two courses are taken for the same
APART = 0.95  # of the greatest correlation; another lag that comes closer makes it ambiguous
SETTLED = 0.01  # of a channel's spread, by which two simulations may differ
NEAR = 5  # samples, by which the errors of an FMU may shift its outputs
FOLLOWED = "found: with it, outputs follow a simulation"
ALIKE = 0.5  # of the greatest correlation; nearer lags belong to the same peak


@dataclass(frozen=True)
class Lag:
    """How much later a signal runs than another one, s; likeness: their correlation there, at most 1.

    other: the greatest correlation at any other lag.
    """

    seconds: float
    likeness: float
    other: float

    @property
    def sure(self) -> bool:
        """Whether no other lag comes near."""
        return self.likeness >= LEAST and self.other < APART * self.likeness


ONE = Lag(0.0, 1.0, 0.0)  # nothing was sought


def with_clocks(made: Draft, isolation: Isolation | None) -> Draft:
    """The draft with the clocks of its files, as far as they can be found; isolation: of a foreign FMU.

    Channels of one file have one clock, files with dates are put together by these, and others by a channel
    that both have measured. Without one, the FMU is simulated with the inputs of their file, if all lie in
    one, and the outputs of the other files are sought in it: what the FMU does not know may then shift a
    clock by a few samples.
    """
    driving = dict.fromkeys(s.raster for s in made.inputs)
    if not made.others:
        return made
    if len(driving) != 1:  # no simulation before their clocks are known
        return _found(made, None)
    [first] = driving
    try:
        with Fmu(made.fmu, isolation_of(made.fmu, isolation)) as fmu:
            return _found(made, Driven(fmu, made, first))
    except (FmuError, FmuEnded):  # it does not bear the record; the commands that need it will say why
        return made


class Driven:
    """The FMU of a draft with the inputs of a record, whose raster is `first`."""

    def __init__(self, fmu: Fmu, made: Draft, first: Raster) -> None:
        self._fmu, self.first = fmu, first
        self._inputs = {s.variable.name: _in_unit(s.variable, s, _filled(s, first)) for s in made.inputs}
        self.outputs = [s.variable.name for s in made.outputs]

    def __call__(self, begin: int = 0) -> dict[str, Array]:
        """All measured outputs, (N - begin,) each, from sample `begin` of the record on."""
        given = {name: x[begin:] for name, x in self._inputs.items()}
        y = self._fmu.simulate(self.first.t[begin:], given, self.outputs, {})
        return dict(zip(self.outputs, y.T, strict=True))


def _found(made: Draft, driven: Driven | None) -> Draft:
    """The draft with the clocks that can be found, and with the time after which the FMU is in step."""
    first, simulated = (driven.first, driven()) if driven else (made.raster, {})
    lags = {first: (ONE, "")}
    for r in (made.raster, *made.others):
        if r is not first:
            found = _known(first, r) or _shared(first, r)
            found = found or (_followed(made, simulated, first, r) if driven else None)
            lags |= {r: found} if found and found[0].sure else {}
    if made.raster not in lags:
        return made
    places = max(0, 1 - floor(log10(made.raster.step)))
    clocks, own = {}, lags[made.raster][0].seconds
    for r in made.others:
        if r in lags:
            lag, how = min((lags[r], lags[made.raster]), key=lambda found: (found[0].likeness, not found[1]))
            offset = round(float(lags[r][0].seconds - own - r.after(made.raster)), places)
            if how == FOLLOWED and abs(offset) < NEAR * made.raster.step:
                offset, how = 0.0, f"{how} as well as with {offset!r}, so that the clocks are taken as one"
            said = f" (correlation {lag.likeness:.3f}, {max(lag.other, 0.0):.2f} at any other)"
            clocks[r] = Clock(offset, how + said if lag.other or lag.likeness < 1 else how)
    begun = replace(made, clocks=clocks)
    if driven is None:
        return begun
    return replace(begun, settling=settling(driven, simulated, begun.split[0] + own))


def _known(one: Raster, other: Raster) -> tuple[Lag, str] | None:
    """The lag of a raster by its file or its dates; None if they do not tell."""
    if one.file == other.file:
        return replace(ONE, seconds=other.after(one)), "the same file, so that it is the same clock"
    if one.begin is None or other.begin is None:
        return None
    return replace(ONE, seconds=other.after(one)), "by the dates of both files"


def _followed(made: Draft, simulated: Mapping[str, Array], first: Raster, other: Raster) -> tuple[Lag, str]:
    """The lag of a raster by its outputs, which follow a simulation of the FMU."""
    pairs = [(simulated[s.variable.name], s.channel.x) for s in made.outputs if s.raster is other]
    return lag_of(first.t, [one for one, _ in pairs], other.t, [x for _, x in pairs]), FOLLOWED


def _shared(one: Raster, other: Raster) -> tuple[Lag, str] | None:
    """The lag of a raster by a channel that both have measured, without a simulation; None without one."""
    found = [
        (lag_of(one.t, [c.x], other.t, [d.x]), f"found: with it, '{d.name}' follows '{c.name}'")
        for c in one.channels
        for d in other.channels
        if _same(c, d)
    ]
    return max((f for f in found if f[0].sure), key=lambda f: f[0].likeness, default=None)


def _same(one: Channel, other: Channel) -> bool:
    """Whether two channels can be measurements of the same quantity, by their units and names."""
    units = [c.unit or "" for c in (one, other)]
    if not (all(map(known, units)) and alike(*units)):
        return False
    both = quantities_of(one.name), quantities_of(other.name)
    return words_of(one.name) == words_of(other.name) or bool(set(both[0]) & set(both[1]))


def settling(driven: Driven, simulated: Mapping[str, Array], begin: float) -> float:
    """How long a simulation that begins at a time, s, differs from one of the whole record, s.

    Infinite if it always does.
    """
    t = driven.first.t
    i = int(np.searchsorted(t, begin).clip(max=t.size - 2))
    late, last = driven(i), 0
    for name, x in late.items():
        apart = np.abs(x - simulated[name][i:]) > SETTLED * np.std(simulated[name])
        last = max(last, int(np.flatnonzero(apart)[-1]) + 1 if apart.any() else 0)
    return float(t[i + last] - t[i]) if i + last < t.size else float("inf")


def _filled(s: Signal, raster: Raster) -> Array:
    """The samples of a channel (N,), lost ones straight between their neighbours."""
    there = np.isfinite(s.channel.x)
    return np.asarray(np.interp(raster.t, raster.t[there], s.channel.x[there]))


def _in_unit(v: FmuVariable, s: Signal, x: Array) -> Array:
    """Samples of a channel x (N,) in the unit of the FMU, as far as it is known."""
    unit = v.unit or s.model_unit
    if not (s.unit and unit):
        return x
    factor, offset = column_conversion(s.unit, unit, v.name, s.channel.name)
    return np.asarray(x * factor + offset)


def lag_of(t: Array, ones: list[Array], u: Array, others: list[Array]) -> Lag:
    """How much has to be added to the times u (M,) so that signals there have the course of those at t (N,).

    ones: (N,) each; others: (M,) each, in any unit. The correlation of each pair is that of the samples that
    overlap at a lag, so that a part of a long record is found in it; the mean over the pairs decides.
    """
    step = max(step_of(t), step_of(u))
    here, there = (np.arange(x[0], x[-1], step) for x in (t, u))
    found = np.mean(
        [
            overlapping(at_times(here, t, one), at_times(there, u, other))
            for one, other in zip(ones, others, strict=True)
        ],
        axis=0,
    )
    best = int(np.argmax(found))
    low, high = _peak(found, best)
    elsewhere = np.concatenate([found[:low], found[high + 1 :]])
    lag = best + _between(found, best) - (there.size - 1)
    other = float(elsewhere.max(initial=-1.0))
    return Lag(here[0] - there[0] + lag * step, float(found[best]), other)


def overlapping(one: Array, other: Array) -> Array:
    """Correlation coefficients (N + M - 1,) of signals (N,) and (M,) at each shift, of what overlaps there.

    nan are left out; -1 where too little overlaps. Sums over the overlap are correlations with masks
    (D. Padfield, IEEE Transactions on Image Processing 21 (2012), 2706-2718).
    """
    a, b = (np.nan_to_num(x - np.nanmean(x)) for x in (one, other))
    m, n = (np.isfinite(x).astype(float) for x in (one, other))

    def sums(x: Array, y: Array) -> Array:
        return np.asarray(correlate(x, y, "full", "fft"))

    count = np.round(sums(m, n))
    left, right = sums(a, n), sums(m, b)
    safe = np.maximum(count, 1.0)
    shared = sums(a, b) - left * right / safe
    spreads = (sums(a * a, n) - left**2 / safe) * (sums(m, b * b) - right**2 / safe)
    least = 1e-9 * np.sum(a * a) * np.sum(b * b) + 1e-300
    found = np.where(spreads > least, shared / np.sqrt(np.maximum(spreads, least)), -1.0)
    return np.where(count >= OVERLAP * min(m.sum(), n.sum()), found, -1.0)


def _peak(found: Array, best: int) -> tuple[int, int]:
    """First and last shift of the peak about the best one: until the correlation has halved."""
    below = np.flatnonzero(found < ALIKE * found[best])
    left, right = below[below < best], below[below > best]
    return (int(left[-1]) if left.size else 0), (int(right[0]) if right.size else found.size - 1)


def _between(found: Array, best: int) -> float:
    """Where between samples the correlation is greatest, in samples from the best, by a parabola."""
    if not 0 < best < found.size - 1:
        return 0.0
    before, here, after = found[best - 1 : best + 2]
    bend = before - 2 * here + after
    return 0.0 if bend >= 0 else float(np.clip((before - after) / (2 * bend), -0.5, 0.5))
