"""What a fit of the kernel to samples found."""

from dataclasses import dataclass

from maipp.belief.kernel import Matern32


@dataclass(frozen=True)
class KernelFit:
    """A Matern 3/2 kernel with constant mean, fitted to samples; lengths and values in the samples' own units.

    Errors are standard errors from the Fisher information (of the mean: the generalised least squares one), None for a
    parameter on its bound. They hold for many samples; with few, or a length scale near the size of the area, the true
    spread is larger and skewed upwards.
    """

    mean: float  # units of the values
    length_scale: float  # units of the positions
    signal_variance: float  # squared units of the values
    noise_variance: float  # squared units of the values
    log_marginal_likelihood: float  # of the samples used, in their units
    samples: int  # how many the kernel was fitted to
    samples_given: int  # how many there were
    mean_error: float  # 0 where the mean was given
    length_scale_error: float | None
    signal_variance_error: float | None
    noise_variance_error: float | None
    axis_length_scales: tuple[float, float] | None  # along x and along y; None for samples on a line
    anisotropy_gain: float | None  # log marginal likelihood that a scale per axis adds, on up to 400 samples
    on_bound: tuple[str, ...]  # of length_scale_low, length_scale_high, noise_low, noise_high
    extent: float  # longest side of the samples' box, units of the positions
    warnings: tuple[str, ...] = ()  # what to be told before using it, plain sentences

    @property
    def kernel(self) -> Matern32:
        """The covariance of the field, without the noise."""
        return Matern32(self.length_scale, self.signal_variance)
