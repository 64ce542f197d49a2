"""When the noise of a recorded input is seen, and how it is smoothed and carried on."""

from dataclasses import dataclass

from estimator.limits import limit


@dataclass(frozen=True)
class InputPolicy:
    """Limits of the noise of the recorded inputs: when it is noise, and how it is smoothed and carried on."""

    segment: int = limit(
        256,
        "samples",
        "shortest segments of an input whose spectra show its white noise",
        "derivation: 64 frequencies in the upper octave, of which two halves can be compared",
    )
    segments: int = limit(
        8,
        "segments",
        "segments into which an input is cut, beside those that overlap two of them",
        "derivation: the median of all scatters by half of its mean at one frequency, by 7 % over the octave",
    )
    flat: float = limit(
        3.0,
        "standard deviations",
        "difference between the two halves of an input's upper octave, above which it is not noise",
        "derivation: 1 in 700, as `chance`",
    )
    levels: int = limit(
        10,
        "scales",
        "scales of the wavelets, each twice as long as the one before; slower noise stays in the input",
        "derivation: the slowest lasts 1024 samples, in whose mean the noise is a thirtieth of its size",
    )
    seen: float = limit(
        1.0,
        "sum of squares, in units of the noise",
        "change of the outputs by smoothing, below which the inputs are left as they were recorded",
        "derivation: one standard error of a quantity with this response, so no fit could show it",
    )
    draws: int = limit(
        4,
        "draws",
        "draws of the noise that stays in the inputs, from which that of the outputs is estimated",
        "derivation: each draw is as long as the record, so that four have half of its scatter",
    )
