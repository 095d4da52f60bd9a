"""What is known before the survey: old samples and the kernel, fitted to them, given, or assumed."""

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from maipp.errors import InputError
from maipp.fields.samples import Samples, load_samples
from maipp.geo import WGS84, Crs, GeoReference
from maipp.scenario import Scenario
from maipp.surveys.area import OperatingArea
from maipp.surveys.clean import Cleaned, fitted, merged, without_spikes
from maipp.surveys.joined import joined
from maipp.surveys.mission_file import MissionFile, SampleFile
from maipp.surveys.projected_area import ProjectedArea
from maipp.surveys.systems import file_system, to_user
from maipp.typing import Float

if TYPE_CHECKING:  # it imports JAX
    from maipp.belief.refit import HyperPrior

# Standardised noise variance where nobody says how well the robots measure: 5 % of the prior standard deviation.
_ASSUMED_NOISE = 0.05**2
_LEAST_NOISE = 1e-6  # below, the kernel matrix of neighbouring measurements cannot be factored in single precision
_SCALES = (0.02, 3.0)  # domain units: beyond, a field looks like noise, or constant, to any planner
# Standardised threshold of the paper's experiments, which the weights that ship were trained with.
_PAPER_THRESHOLD = 0.4
_PAPER_LENGTH_SCALE = 0.45  # of the side of a square
# Standard deviation of the logarithm of the noise variance, and what the guess of the field's standard deviation is
# worth in measurements (twice this), where it was told, where a threshold led to it, and where nothing did.
_NOISE_TOLD, _NOISE_ASSUMED = 0.5, 1.5
_TOLD_SCALE, _THRESHOLD_SCALE, _NO_SCALE = 5.0, 0.1, 0.01
# More old samples than this make every decision slow and tell it little: they are thinned by place.
MOST_SAMPLES = 400


@dataclass(frozen=True, eq=False)
class Prior:
    """The Gaussian-process prior in the scenario's terms, and the samples that it is conditioned on."""

    frame: GeoReference  # with the values standardised
    length_scale: float  # domain units
    noise: float  # standardised variance
    x: Float[np.ndarray, "p 2"]  # old samples, domain units
    y: Float[np.ndarray, " p"]  # standardised values
    sample_noise: float  # standardised variance of the samples' noise
    fit: Any  # belief.fit.KernelFit, or None without samples
    warnings: tuple[str, ...]


def find_prior(survey: MissionFile, place: ProjectedArea, space: OperatingArea) -> Prior:
    """The prior of a survey: what the file says of the kernel wins over the fit, the fit over assumptions.

    Raises `InputError` for samples that cannot be used.
    """
    warnings: list[str] = []
    frame, kernel, fit = place.frame, survey.kernel, None
    x, values = np.zeros((0, 2)), np.zeros(0)
    if survey.samples is not None:
        samples = _samples(survey, place, warnings)
        given = (kernel.length_scale_m, kernel.mean, kernel.std)
        if any(value is None for value in given):
            fit_to = partial(_fit, survey, kernel.mean)
            if survey.samples.check:
                samples, fit = fitted(samples, fit_to)
            else:
                fit = fit_to(samples.x, samples.y)
            warnings += [f"{survey.samples.file.name}: {note}" for note in (*samples.notes, *fit.warnings)]
        x, values = samples.x, samples.y
    metres, mean, std, assumed = _kernel(survey, fit, math.sqrt(space.region.area))
    if assumed:
        warnings.append(
            f"{' and '.join(assumed)} assumed for want of samples: give old measurements (samples) or a kernel"
        )
    frame = frame.standardised(mean, std, below=survey.below)
    scale = metres / frame.scale
    if not _SCALES[0] <= scale <= _SCALES[1]:
        clipped = min(max(scale, _SCALES[0]), _SCALES[1])
        warnings.append(
            f"the length scale of {metres:.4g} m does not fit an area {frame.scale:.4g} m long; "
            f"planned with {clipped * frame.scale:.4g} m"
        )
        scale = clipped
    if survey.noise is not None:
        noise = (survey.noise / std) ** 2
    elif fit is not None:
        noise = fit.noise_variance / std**2
    else:
        noise = _ASSUMED_NOISE
    sample_noise = noise if fit is None else fit.noise_variance / std**2
    return Prior(
        frame=frame,
        length_scale=scale,
        noise=_bounded(noise),
        x=frame.plane_to_domain(x),
        y=np.asarray(frame.to_domain_values(values)),
        sample_noise=_bounded(sample_noise),
        fit=fit,
        warnings=tuple(warnings),
    )


def hyper_prior(survey: MissionFile, scenario: Scenario, fit: Any) -> "HyperPrior | None":
    """What the kernel is refitted with under way, around the one assumed; None where it is to stay."""
    kernel = survey.kernel
    given = (kernel.length_scale_m, kernel.mean, kernel.std)
    unknown = survey.samples is None and all(value is None for value in given)
    if not (unknown if kernel.adapt is None else kernel.adapt):
        return None
    from maipp.belief.refit import HyperPrior

    known_std = kernel.std is not None or fit is not None
    return HyperPrior(
        length_scale=scenario.length_scale,
        noise=scenario.noise,
        std=math.sqrt(scenario.signal_variance),
        noise_spread=_NOISE_TOLD if survey.noise is not None or fit is not None else _NOISE_ASSUMED,
        weight=_TOLD_SCALE if known_std else _NO_SCALE if survey.threshold is None else _THRESHOLD_SCALE,
        level_known=kernel.mean is not None or fit is not None,
        shortest=_SCALES[0],
        longest=_SCALES[1],
    )


def _bounded(noise: float) -> float:
    return float(min(max(noise, _LEAST_NOISE), 1e6))


def _kernel(survey: MissionFile, fit: Any, side: float) -> tuple[float, float, float, list[str]]:
    """Length scale (metres), mean and standard deviation (unit), and what of them is assumed, in words.

    `side` is that of a square as large as the free area, metres.
    """
    kernel, assumed = survey.kernel, []
    metres, std, mean = kernel.length_scale_m, kernel.std, kernel.mean
    if fit is not None:
        fitted = fit.length_scale, math.sqrt(fit.signal_variance), fit.mean
        metres, std, mean = (a if b is None else b for a, b in zip(fitted, (metres, std, mean), strict=True))
    if metres is None:
        metres = _PAPER_LENGTH_SCALE * side
        assumed.append(f"length scale {metres:.4g} m")
    if std is None:
        std = abs(survey.threshold) / 2 if survey.threshold else 1.0
        assumed.append(f"standard deviation {std:.4g} {survey.unit or ''}".rstrip())
    if mean is None:
        sign = -1.0 if survey.below else 1.0
        mean = 0.0 if survey.threshold is None else survey.threshold - sign * _PAPER_THRESHOLD * std
        assumed.append(f"mean {mean:.4g} {survey.unit or ''}".rstrip())
    return float(metres), float(mean), float(std), assumed


def _samples(survey: MissionFile, place: ProjectedArea, warnings: list[str]) -> Cleaned:
    """The samples in and near the area, one a place: local metres and values in the unit; adds to the warnings."""
    assert survey.samples is not None
    path = survey.samples.file
    samples = load_samples(path, **survey.samples.columns) if survey.samples.track is None else joined(survey.samples)
    told = list(samples.notes)
    if samples.dropped:
        told.append(f"{samples.dropped} lines without a position or a value left out")
    crs = file_system(_system(survey.samples, samples, place.crs), place.crs, str(path))
    metres = place.frame.to_plane(to_user(samples.points, crs, str(path)))
    distance = shapely.distance(place.area, shapely.points(metres))
    inside = int((distance <= 0).sum())
    if not inside:
        hint = "are its columns swapped, or its coordinates of another kind than the mission's (give samples.crs)?"
        raise InputError(f"{path}: none of its {len(samples.value)} samples lies in the area; {hint}")
    # From half the longest side of the area on a sample tells nothing of it.
    near = np.asarray(distance <= place.frame.scale / 2)
    if not near.all():
        told.append(f"{int((~near).sum())} of {len(near)} samples lie far from the area; left out")
    found = merged(metres[near], samples.value[near], samples.lines[near])
    found = without_spikes(found) if survey.samples.check else found
    warnings += [f"{path.name}: {note}" for note in (*told, *found.notes)]
    return found._replace(notes=[])


def _system(file: SampleFile, samples: Samples, own: Crs) -> Crs | None:
    """What the file's positions are; None where neither the mission nor the columns' names say."""
    return file.crs or (WGS84 if samples.geographic and not own.geographic else None)


def _fit(survey: MissionFile, mean: float | None, x: Float[np.ndarray, "p 2"], values: Float[np.ndarray, " p"]) -> Any:
    from maipp.belief.fit import fit_kernel

    assert survey.samples is not None
    try:
        return fit_kernel(x, values, mean=mean)
    except InputError as error:
        raise InputError(f"{survey.samples.file}: {error}; or give length_scale_m, mean and std under kernel") from None
