"""The limits of filters that can change an estimate, its error or what is said of it, in one object."""

from dataclasses import dataclass

from estimator.limits import Limits, limit


@dataclass(frozen=True)
class FilterPolicy(Limits):
    """Limits of the consistency tests, of identifiability, and of noise that is learned from the record."""

    false_rejection: float = limit(
        0.05,
        "probability",
        "with which any test of consistency rejects a filter whose model and noise are right; it is divided "
        "evenly between the tests",
        "convention: the level of a 95 % band; divided after Bonferroni",
    )
    lags: int = limit(
        20,
        "samples",
        "largest lag of the autocorrelation in the test of whiteness",
        "convention: a usual number for the test of Ljung and Box (1978) on some hundred samples and more",
    )
    informed: float = limit(
        0.9,
        "posterior over prior standard deviation",
        "ratio below which the record says something about an unknown",
        "derivation: at 0.9 the record holds a fifth of the information that the prior and it hold together",
    )
    alike: float = limit(
        0.99,
        "correlation",
        "correlation above which only a combination of two unknowns is determined",
        "derivation: at 0.99 a fixed value of one would make the error of the other a seventh",
    )
    most_raised: float = limit(
        2.0,
        "ratio",
        "by which one sample raises a variance that is matched to the innovations at most",
        "convention: an outlier of ten standard deviations is not noise of a hundred times the power",
    )
    declared_samples: int = limit(
        20,
        "samples",
        "as many as the declared noise counts for at the start, where it is matched to the innovations",
        "derivation: a variance from 20 samples is known to within a third, as well as a data sheet says it",
    )
    noise_samples: int = limit(
        800,
        "samples",
        "first samples of the record from which process noise that is not declared is estimated",
        "derivation: a variance from 800 samples is known to within a twentieth",
    )
    least_noise: float = limit(
        1e-5,
        "share of a state's own motion",
        "smallest process noise that the search tries",
        "convention: a hundred thousandth of the motion is as good as none",
    )
    most_noise: float = limit(
        10**0.5,
        "share of a state's own motion",
        "largest process noise that the search tries",
        "derivation: three times the motion itself explains it by noise alone",
    )
    noise_learnt: int = limit(
        20_000,
        "samples",
        "first samples of the record from which noise of a sensor that is not declared is estimated",
        "derivation: a variance from 20 000 samples is known to within a hundredth",
    )
    noise_gain: float = limit(
        0.01,
        "log units of likelihood",
        "gain that a further step promises, below which the search for the noise of the sensors ends",
        "derivation: what is found is then within a seventh of a standard error of the likeliest",
    )
    noise_unseen: float = limit(
        0.01,
        "information about the logarithm of a size or time, or the logit of a share",
        "added to what the record holds of each, so that what it does not show stays where it begins",
        "derivation: its standard error is then ten, a factor of 22 000, which is as good as unknown",
    )
    least_white: float = limit(
        1e-3,
        "share of the variance that correlated noise gains in a sample",
        "smallest variance of the white noise beside it",
        "derivation: innovations are then correlated by a thousandth, which shows in a million samples",
    )
    least_share: float = limit(
        1e-3,
        "share of the variance of a sensor's noise",
        "smallest part that is correlated, and smallest part that is white, where this is estimated",
        "convention: a part of 3 % of the noise's standard deviation is as good as none",
    )
    gate_patience: int = limit(
        50,
        "samples",
        "in a row that a gate leaves out of a channel, after which the channel is used again",
        "convention: then the model is wrong and not the sensor",
    )
    adapted_samples: float = limit(
        500.0,
        "samples",
        "memory with which noise is adapted to the innovations",
        "derivation: a variance from 500 samples is known to within a sixteenth",
    )
    least_adapted: float = limit(
        1e-2,
        "times the declared variance",
        "smallest variance to which noise is adapted",
        "convention: a sensor is not ten times better than declared",
    )
    most_adapted: float = limit(
        1e4,
        "times the declared variance",
        "largest variance to which noise is adapted",
        "convention: a sensor of a hundred times the noise says nothing",
    )
    particles: int = limit(
        300,
        "particles",
        "of the filter `rbpf`",
        "derivation: a standard deviation from 300 particles is known to within a twentieth",
    )
    particles_that_count: float = limit(
        0.5,
        "share of the particles",
        "effective number of particles (1 over the sum of squared weights) below which they are drawn again",
        "convention: half of them, as is usual since Liu and Chen (1998)",
    )
    kernel_discount: float = limit(
        0.98,
        "1",
        "discount of the kernel by which particles are spread when they are drawn again",
        "Liu and West (2001), who advise 0.95 to 0.99",
    )
    least_kernel: float = limit(
        1e-3,
        "standard deviations at the start",
        "smallest spread of this kernel",
        "convention: particles that have become alike can still follow a slow change",
    )


POLICY = FilterPolicy()
