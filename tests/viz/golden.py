"""`python -m tests.viz.golden` draws the pictures that tests/viz/test_golden.py compares with, into tests/viz/golden.

Look at what has changed in them before they are kept.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

FOLDER = Path(__file__).with_name("golden")
DPI = 50


def overview() -> Figure:
    """The maps of a survey made by hand."""
    from maipp.viz.overview import draw_overview
    from tests.viz.conftest import by_hand

    return draw_overview(by_hand(), dpi=DPI)


def kernel_fit() -> Figure:
    """The picture of a kernel, fitted to a wave."""
    from maipp.belief.fit import fit_kernel
    from maipp.viz.kernel_fit import draw_kernel_fit

    x = np.stack(np.meshgrid(np.linspace(0, 900, 8), np.linspace(0, 900, 8)), axis=-1).reshape(-1, 2)
    y = 12 + np.sin(x[:, 0] / 150) + 0.3 * np.cos(x[:, 1] / 70)
    return draw_kernel_fit(fit_kernel(x, y), x, y, length_unit="m", unit="ug/L", dpi=DPI)


def curves() -> Figure:
    """Tr(P) over the distance of two rows of a table."""
    from maipp.bench.drawings import draw_curves

    rows = [
        {"row": row, "instance": instance, "distance": distance, "trace": 60 * np.exp(-rate * distance) + instance}
        for row, rate in (("greedy", 0.8), ("intent-paths", 1.2))
        for instance in range(3)
        for distance in np.linspace(0, 3, 16)
    ]
    return draw_curves(pd.DataFrame(rows), "Tr(P) under way")


def scaling() -> Figure:
    """Costs of two planners over two axes."""
    from maipp.bench.drawings import draw_scaling

    rows = [
        {"planner": planner, "axis": axis, "agents": 3, "nodes": 200, axis: size}
        | {"memory_mb": 90 * size**0.2, "decision_ms": cost * size}
        for planner, cost in (("greedy", 1.5), ("intent-search", 40.0))
        for axis, sizes in (("agents", (3, 10, 30)), ("nodes", (100, 200, 400)))
        for size in sizes
    ]
    return draw_scaling(pd.DataFrame(rows))


FIGURES: dict[str, Callable[[], Figure]] = {
    "overview": overview,
    "kernel_fit": kernel_fit,
    "curves": curves,
    "scaling": scaling,
}


def pixels(figure: Figure) -> np.ndarray:
    """The figure as (h, w, 3) uint8."""
    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def kept(name: str) -> np.ndarray:
    """The picture that is kept, (h, w, 3) uint8."""
    with Image.open(FOLDER / f"{name}.png") as picture:
        return np.asarray(picture.convert("RGB"))


def main() -> None:
    """Draw them all anew."""
    FOLDER.mkdir(exist_ok=True)
    for name, make in FIGURES.items():
        Image.fromarray(pixels(make())).save(FOLDER / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
