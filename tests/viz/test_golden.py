"""Figures look as those that are kept in tests/viz/golden: colours, places, labels, legends."""

import numpy as np
import pytest

from tests.viz.golden import FIGURES, FOLDER, kept, pixels

# Root mean square over all pixels, of 255: for edges that other rounding of the maps, or another FreeType, draws a
# fraction of a pixel away. A picture moved by half a pixel differs by 7.6 to 12.8, one without the lines of a panel by
# more than 2.
TOLERANCE = 1.0


def differences(one: np.ndarray, other: np.ndarray) -> float:
    assert one.shape == other.shape
    return float(np.sqrt(np.mean((one.astype(float) - other) ** 2)))


@pytest.mark.parametrize("name", FIGURES)
def test_the_figure_is_the_kept_one(name):
    figure = FIGURES[name]()
    assert differences(pixels(figure), kept(name)) < TOLERANCE, "look at it; python -m tests.viz.golden keeps it"
    for line in [*figure.axes[0].lines]:
        line.remove()
    assert differences(pixels(figure), kept(name)) > TOLERANCE


def test_they_are_small():
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 200_000
