"""Maps of a belief, small enough to be sent again and again."""

import base64
from typing import Any

import numpy as np

from maipp.live.belief_maps import BeliefMaps
from maipp.typing import Bool
from maipp.viz.report_data import packed


def maps_part(maps: BeliefMaps, robot: str | None, mark: str) -> dict[str, Any]:
    """Mean, standard deviation, and surplus over the threshold as pictures, rows going north.

    They are packed as in a report. `mark` says what the belief is made of: with the same mark it is the same.
    """
    inside = _picture(maps.inside)
    told = {"robot": robot, "mark": mark, "measurements": maps.measurements, "side": len(inside)}
    for name in ("mean", "std", "surplus"):
        told[name] = packed(_picture(getattr(maps, name))[None], signed=name == "surplus")
    return told | {"inside": base64.b64encode(np.packbits(inside, bitorder="little").tobytes()).decode("ascii")}


def _picture(values: np.ndarray | Bool[np.ndarray, " q"]) -> np.ndarray:
    side = round(len(values) ** 0.5)
    return values.reshape(side, side).T  # the grid goes north first
