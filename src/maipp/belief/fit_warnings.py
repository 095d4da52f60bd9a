"""What a person should be told of a fitted kernel before using it."""

from maipp.belief.kernel_fit import KernelFit

_FEW = 30  # samples below which the estimates scatter by about half

# Twice the gain is compared with chi-squared of one degree of freedom: 6.6 has a probability of 1 %. And a ratio of
# scales that planning would notice.
_GAIN, _RATIO = 3.3, 1.5


def fit_warnings(fit: KernelFit) -> tuple[str, ...]:
    """One plain sentence for each thing that makes the kernel less sure, or less right, than it looks."""
    told = []
    if fit.samples < fit.samples_given:
        told.append(
            f"The kernel was fitted to {fit.samples} of the {fit.samples_given} samples, chosen for their places alone."
        )
    if fit.samples < _FEW:
        told.append(f"There are only {fit.samples} samples; with fewer than {_FEW} the kernel is a rough guess.")
    if "length_scale_high" in fit.on_bound:
        told.append(
            f"The length scale is at the upper limit of the search ({fit.length_scale:.3g}): over the area of the "
            "samples the values look like a slope, so neither length scale nor variance can be told."
        )
    elif fit.length_scale > fit.extent:
        told.append(
            f"The length scale ({fit.length_scale:.3g}) is longer than the area of the samples ({fit.extent:.3g}), "
            "so it is known only roughly, and so is the variance."
        )
    if "noise_high" in fit.on_bound:
        told.append("No pattern in space was found: the samples look like noise around their mean.")
    elif "length_scale_low" in fit.on_bound:
        told.append(
            f"The length scale is at the lower limit of the search ({fit.length_scale:.3g}): samples that are "
            "neighbours tell nothing of each other, and a survey would learn nothing between its measurements."
        )
    if "noise_low" in fit.on_bound:
        told.append("The samples show no noise; the smallest that was tried is used.")
    total = fit.signal_variance + fit.noise_variance
    if fit.noise_variance > 0.5 * total and "noise_high" not in fit.on_bound:
        told.append(
            f"Noise dominates: {fit.noise_variance / total:.0%} of the variance of the values is noise, "
            "not a pattern in space."
        )
    if fit.axis_length_scales is None:
        told.append("All samples lie on one line, so nothing is known of how the values change across it.")
    elif fit.anisotropy_gain is not None and fit.anisotropy_gain > _GAIN:
        along_x, along_y = fit.axis_length_scales
        ratio = max(along_x, along_y) / min(along_x, along_y)
        if ratio > _RATIO and not {"length_scale_high", "noise_high"} & set(fit.on_bound):
            fast, slow = ("x", "y") if along_x < along_y else ("y", "x")
            told.append(
                f"The values change faster along {fast} than along {slow} (length scales {along_x:.3g} in x and "
                f"{along_y:.3g} in y, log likelihood higher by {fit.anisotropy_gain:.3g}); "
                "planning uses one length scale for both."
            )
    return tuple(told)
