"""Ways in which the records of a set are measured, beyond white noise of declared size."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from tests.truth.rig_inputs import Array

Outputs = dict[str, Array]
DECLARED = re.compile(r"^noise_std = .*\n", re.MULTILINE)


@dataclass(frozen=True)
class Measuring:
    """White noise of declared size; other ways override what they do differently."""

    name = "white"
    rng: np.random.Generator

    def inputs(self, t: Array, inputs: Outputs) -> Outputs:
        """The inputs as recorded."""
        return inputs

    def outputs(self, t: Array, clean: Outputs, noise: Mapping[str, float]) -> Outputs:
        """The outputs as recorded; noise: its standard deviation by output."""
        return {o: y + self.rng.normal(0.0, noise[o], y.size) for o, y in clean.items()}

    def said(self, text: str) -> str:
        """What the experiment file says, from the text that says everything."""
        return text


class Correlated(Measuring):
    """Half of the noise's variance, or all of it, is correlated over 0.05 to 0.5 s; its size is declared."""

    name = "correlated"

    def outputs(self, t: Array, clean: Outputs, noise: Mapping[str, float]) -> Outputs:
        """See Measuring."""
        share, time = float(self.rng.choice([0.5, 1.0])), 0.05 * 10 ** self.rng.uniform()
        kept = float(np.exp(-(t[1] - t[0]) / time))
        found = {}
        for o, y in clean.items():
            white, drawn = self.rng.standard_normal((2, y.size))
            before = self.rng.standard_normal(1)  # so that the noise has its full size from the first sample
            slow, _ = lfilter([np.sqrt(1 - kept**2)], [1.0, -kept], drawn, zi=kept * before)
            found[o] = y + noise[o] * (np.sqrt(1 - share) * white + np.sqrt(share) * slow)
        return found


class Undeclared(Measuring):
    """White noise whose size the experiment file does not say."""

    name = "undeclared"

    def said(self, text: str) -> str:
        """See Measuring."""
        return DECLARED.sub("", text)


class Unknown(Correlated, Undeclared):
    """As in `correlated`, and the experiment file says nothing of the noise."""

    name = "unknown"


class Quantised(Measuring):
    """White noise, then rounding to steps of 1 to 6 times that noise; the size of both is declared."""

    name = "quantised"

    def outputs(self, t: Array, clean: Outputs, noise: Mapping[str, float]) -> Outputs:
        """See Measuring."""
        found = {}
        for o, y in clean.items():
            steps = 6 ** self.rng.uniform()
            white = noise[o] / np.sqrt(1 + steps**2 / 12)  # a step contributes a twelfth of its square
            step = steps * white
            found[o] = step * np.round((y + self.rng.normal(0.0, white, y.size)) / step)
        return found


class Inputs(Measuring):
    """The recorded inputs have white noise of 0.5 to 2 % of their rms, of which the file says nothing."""

    name = "inputs"

    def inputs(self, t: Array, inputs: Outputs) -> Outputs:
        """See Measuring."""
        share = 0.005 * 4 ** self.rng.uniform()
        return {
            n: u + share * float(np.sqrt(np.mean(u**2))) * self.rng.standard_normal(u.size)
            for n, u in inputs.items()
        }


class Clock(Measuring):
    """The outputs' clock is up to one sample early or late, and their times jitter by 5 % of a sample."""

    name = "clock"

    def outputs(self, t: Array, clean: Outputs, noise: Mapping[str, float]) -> Outputs:
        """See Measuring."""
        dt = float(t[1] - t[0])
        seen = np.clip(
            t + dt * (self.rng.uniform(-1, 1) + 0.05 * self.rng.standard_normal(t.size)), t[0], t[-1]
        )
        return super().outputs(t, {o: CubicSpline(t, y)(seen) for o, y in clean.items()}, noise)


WAYS: dict[str, type[Measuring]] = {
    way.name: way for way in (Measuring, Correlated, Undeclared, Unknown, Quantised, Inputs, Clock)
}
EACH = "each"  # of the ways beyond white noise, in turn
