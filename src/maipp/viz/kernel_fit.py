"""A fitted kernel in one picture: its variogram over that of the samples, and how surely its length scale is known."""

import textwrap

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from maipp.belief.fit_profile import likelihood_profile
from maipp.belief.kernel_fit import KernelFit
from maipp.belief.variogram import empirical_variogram
from maipp.viz.style import AGENT_COLOURS, GREY, MEDIUM, OUTLINE_COLOUR, SMALL, add_axes, heading, new_figure

_WIDTH, _HEIGHT = 4.0, 2.9  # of each plot, inches
_LEFT, _GAP, _RIGHT, _BOTTOM, _TOP = 0.75, 0.85, 0.25, 0.6, 1.0  # margins, inches
_LINE_HEIGHT, _LETTERS = 0.16, 150  # of a warning: height of a line, inches, and letters in it at most
_FITTED, _SAMPLES = AGENT_COLOURS[0], AGENT_COLOURS[5]

# Half the 95 % point of chi-squared with one degree of freedom.
_CONFIDENCE = 1.92


def draw_kernel_fit(
    fit: KernelFit,
    x: Float[np.ndarray, "n 2"],
    y: Float[np.ndarray, " n"],
    *,
    length_unit: str = "",
    unit: str = "",
    dpi: int = 160,
) -> Figure:
    """Variogram and likelihood profile of samples `y` at `x` and of the kernel fitted to them, its warnings below.

    `length_unit` and `unit` are those of the positions and of the values.
    """
    lines = [line for words in fit.warnings for line in textwrap.wrap(words, _LETTERS)]
    bottom = _BOTTOM + _LINE_HEIGHT * (len(lines) + bool(lines))
    figure = new_figure(_LEFT + 2 * _WIDTH + _GAP + _RIGHT, bottom + _HEIGHT + _TOP, dpi)
    _draw_variogram(figure, bottom, fit, x, y, length_unit, unit)
    _draw_profile(figure, bottom, fit, x, y, length_unit)
    heading(figure, _LEFT, f"Kernel fitted to {fit.samples:,} samples", _numbers(fit, length_unit, unit))
    width, height = figure.get_size_inches()
    for number, line in enumerate(reversed(lines)):
        figure.text(_LEFT / width, (0.12 + _LINE_HEIGHT * number) / height, line, fontsize=SMALL, color=OUTLINE_COLOUR)
    return figure


def _draw_variogram(
    figure: Figure,
    bottom: float,
    fit: KernelFit,
    x: Float[np.ndarray, "n 2"],
    y: Float[np.ndarray, " n"],
    length_unit: str,
    unit: str,
) -> None:
    """Half the mean squared difference over distance: samples as points with their pairs, the kernel as a line."""
    axes = add_axes(figure, _LEFT, bottom, _WIDTH, _HEIGHT)
    found = empirical_variogram(x, y)
    at = np.linspace(0.0, 1.05 * found.distance[-1], 200)
    axes.plot(at, fitted_variogram(fit, at), color=_FITTED, lw=1.4, label="fitted kernel")
    axes.axhline(fit.noise_variance, color=_FITTED, lw=0.8, ls=":", label="fitted noise")
    axes.plot(found.distance, found.semivariance, "o", ms=4, color=_SAMPLES, label="samples (number of pairs)")
    for distance, value, pairs in zip(*found, strict=True):
        axes.annotate(
            f"{pairs:,}", (distance, value), (0, 4), textcoords="offset points", fontsize=5.5, color=GREY, ha="center"
        )
    axes.set_xlim(0.0, at[-1])
    axes.set_ylim(0.0, 1.3 * max(found.semivariance.max(), fitted_variogram(fit, at).max()))
    axes.set_title("Variogram", loc="left", fontsize=MEDIUM)
    axes.set_xlabel(_with_unit("distance", length_unit), fontsize=SMALL)
    axes.set_ylabel(_with_unit("half the mean squared difference", f"({unit})²" if unit else ""), fontsize=SMALL)
    axes.legend(fontsize=SMALL, loc="upper left", edgecolor="none", framealpha=0.85)


def _draw_profile(
    figure: Figure, bottom: float, fit: KernelFit, x: Float[np.ndarray, "n 2"], y: Float[np.ndarray, " n"], unit: str
) -> None:
    """The highest log likelihood at each length scale, less the best: flat where the samples do not tell."""
    axes = add_axes(figure, _LEFT + _WIDTH + _GAP, bottom, _WIDTH, _HEIGHT)
    found = likelihood_profile(x, y, also=fit.length_scale)
    axes.plot(found.length_scale, found.log_likelihood, "-o", ms=2.5, lw=1.2, color=_SAMPLES)
    axes.axvline(fit.length_scale, color=_FITTED, lw=1.2, label="fitted length scale")
    axes.axhline(-_CONFIDENCE, color=GREY, lw=0.8, ls=":", label="above: 95 % confidence")
    axes.axvline(fit.extent, color=GREY, lw=0.8, ls="--", label="longest side of the samples' area")
    axes.set_xscale("log")
    axes.set_ylim(max(-20.0, 1.1 * found.log_likelihood.min() - 1.0), 1.0)
    title = "Likelihood over the length scale"
    if found.samples < fit.samples:
        title += f" ({found.samples} of the samples)"
    axes.set_title(title, loc="left", fontsize=MEDIUM)
    axes.set_xlabel(_with_unit("length scale", unit), fontsize=SMALL)
    axes.set_ylabel("log likelihood, less the highest", fontsize=SMALL)
    axes.legend(fontsize=SMALL, loc="lower center", edgecolor="none", framealpha=0.85)


def fitted_variogram(fit: KernelFit, distance: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """Half the mean squared difference that the fitted kernel and its noise expect of samples this far apart."""
    s = np.sqrt(3.0) * distance / fit.length_scale
    return fit.noise_variance + fit.signal_variance * (1.0 - (1.0 + s) * np.exp(-s))


def _numbers(fit: KernelFit, length_unit: str, unit: str) -> str:
    """The parameters with their standard errors, one line."""
    spread, noise = fit.signal_variance**0.5, fit.noise_variance**0.5
    # Of a standard deviation: half the relative error of its variance.
    spread_error = None if fit.signal_variance_error is None else 0.5 * fit.signal_variance_error / spread
    noise_error = None if fit.noise_variance_error is None else 0.5 * fit.noise_variance_error / noise
    parts = [
        ("mean", fit.mean, fit.mean_error or None, unit),
        ("standard deviation", spread, spread_error, unit),
        ("length scale", fit.length_scale, fit.length_scale_error, length_unit),
        ("noise", noise, noise_error, unit),
    ]
    return "   ".join(_number(*part) for part in parts)


def _number(name: str, value: float, error: float | None, unit: str) -> str:
    errors = "" if error is None else f" ± {_shown(error, 2)}"
    return f"{name} {_shown(value, 3)}{errors}{' ' if unit else ''}{unit}"


def _shown(value: float, digits: int) -> str:
    """The value to so many digits, without an exponent for whole numbers that a person would write out."""
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:.0f}" if 10**digits <= abs(rounded) < 1e7 else f"{value:.{digits}g}"


def _with_unit(words: str, unit: str) -> str:
    return f"{words}, {unit}" if unit else words
