"""What is known before: samples in the user's coordinates become the prior, and are told where they do not fit."""

import numpy as np
import pytest

from maipp.belief.fit import fit_kernel
from maipp.errors import InputError
from maipp.surveys.prior import MOST_SAMPLES
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import parse_survey
from tests.surveys.conftest import SQUARE

FITTED = SQUARE.replace("kernel: {length_scale_m: 300, mean: 10, std: 4}\n", "samples: old.csv\n").replace(
    "noise: 0.4\n", ""
)


def field(x, y):
    return 10 + 3 * np.sin(x / 150) + 2 * np.cos(y / 220)


def write(folder, x, y, values, header="x,y,salt"):
    rows = "\n".join(f"{a:.3f},{b:.3f},{v:.4f}" for a, b, v in zip(x, y, values, strict=True))
    (folder / "old.csv").write_text(f"{header}\n{rows}\n", encoding="utf-8")


def prepared(folder, text=FITTED):
    return prepare(parse_survey(text, source="mission.yaml", folder=folder))


@pytest.fixture
def samples(tmp_path):
    rng = np.random.default_rng(4)
    x, y = rng.uniform(0, 1000, (2, 60))
    values = field(x, y) + rng.normal(0, 0.2, 60)
    write(tmp_path, x, y, values)
    return tmp_path, np.round(np.stack([x, y], axis=-1), 3), np.round(values, 4)


def test_the_kernel_is_fitted_to_the_samples(samples):
    folder, x, values = samples
    found = prepared(folder)
    fit = fit_kernel(x, values)
    assert found.frame.mean == pytest.approx(fit.mean) and found.frame.std == pytest.approx(fit.signal_variance**0.5)
    assert found.scenario.length_scale == pytest.approx(fit.length_scale / 1000, rel=1e-6)
    assert found.scenario.noise == pytest.approx(max(fit.noise_variance / fit.signal_variance, 1e-6), rel=1e-6)
    assert found.prior_x == pytest.approx(x / 1000) and found.prior is not None
    assert found.frame.to_user_values(found.prior_y) == pytest.approx(values)
    assert not any("assumed" in warning for warning in found.warnings)


def test_what_the_file_says_wins_over_the_fit(samples):
    folder, _, _ = samples
    text = FITTED + "kernel: {length_scale_m: 123, mean: 9, std: 2}\nnoise: 0.5\n"
    found = prepared(folder, text)
    assert (found.frame.mean, found.frame.std) == (9.0, 2.0) and found.fit is None
    assert found.scenario.length_scale == pytest.approx(0.123) and found.scenario.noise == pytest.approx(1 / 16)
    assert found.prior_noise == found.scenario.noise
    partly = prepared(folder, FITTED + "noise: 0.5\n")
    # The robots' noise is theirs; that of the old samples is fitted.
    assert partly.scenario.noise == pytest.approx((0.5 / partly.frame.std) ** 2)
    assert partly.prior_noise != partly.scenario.noise


def test_low_values_matter_in_samples_too(samples):
    folder, _, values = samples
    found = prepared(folder, FITTED.replace("threshold: 12", "threshold: 8\nbelow: true"))
    assert np.argmax(found.prior_y) == np.argmin(values)
    assert found.frame.to_user_values(found.prior_y) == pytest.approx(values)


def test_samples_far_away_are_left_out_and_told(samples):
    folder, x, values = samples
    write(folder, [*x[:, 0], 1400.0, 9000.0], [*x[:, 1], 500.0, 500.0], [*values, 10.0, 99.0])
    found = prepared(folder)
    assert len(found.prior_y) == 61 and found.prior_x.max() == pytest.approx(1.4)
    assert any("1 of 62 samples lie far from the area; left out" in warning for warning in found.warnings)


def test_many_samples_are_thinned_by_place(tmp_path):
    side = np.linspace(0, 1000, 30)
    x, y = (axis.ravel() for axis in np.meshgrid(side, side))
    write(tmp_path, x, y, field(x, y))
    text = FITTED.replace("samples: old.csv", "samples: old.csv\nkernel: {length_scale_m: 200, mean: 10, std: 3}")
    found = prepared(tmp_path, text)
    assert len(found.prior_y) == MOST_SAMPLES
    assert any(f"of 900 samples {MOST_SAMPLES}, spread evenly" in warning for warning in found.warnings)
    assert np.ptp(found.prior_x, axis=0).min() > 0.9


@pytest.mark.parametrize(
    ("rows", "problem"),
    [
        (("x,y,salt", [5000.0] * 6, list(range(6)), list(range(6))), "none of its 6 samples lies in the area"),
        (("x,y,salt", [1.0, 2.0], [1.0, 2.0], [3.0, 4.0]), "or give length_scale_m, mean and std under kernel"),
        (("x,y,salt", [1.0, 2, 3, 4, 5, 6], [1.0, 2, 3, 4, 5, 7], [3.0] * 6), "old.csv"),
    ],
)
def test_samples_that_cannot_be_used_are_one_line(rows, problem, tmp_path):
    header, x, y, values = rows
    write(tmp_path, x, y, values, header)
    with pytest.raises(InputError) as error:
        prepared(tmp_path)
    assert problem in str(error.value) and "\n" not in str(error.value)


def test_degrees_become_domain_units(tmp_path):
    text = (
        FITTED.replace("metres: true\n", "").replace("1000", "4.01").replace("start: [0, 0]", "start: [4.003, 52.003]")
    )
    text = text.replace(
        "[[[0,0],[4.01,0],[4.01,4.01],[0,4.01]], [[600,600],[700,600],[700,700],[600,700]]]",
        "[[[4,52],[4.01,52],[4.01,52.01],[4,52.01]]]",
    ).replace("start: [50, 50]", "start: [4.003, 52.003]")
    text = (
        text.replace("no_go: [[[200,0],[300,0],[300,500],[200,500]]]\n", "")
        + "kernel: {length_scale_m: 300, mean: 9, std: 2}\n"
    )
    write(tmp_path, [4.005, 4.002], [52.005, 52.002], [9.0, 11.0], "lon,lat,salt")
    found = prepared(tmp_path, text)
    assert found.frame.to_user(found.prior_x) == pytest.approx(np.array([[4.005, 52.005], [4.002, 52.002]]))
    assert found.prior_y == pytest.approx([0.0, 1.0])
