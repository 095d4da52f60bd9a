"""The colours of the page: those of all other pictures."""

from functools import cache
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex

from maipp.viz.style import AGENT_COLOURS, STD_MAP, VALUE_MAP

_INTENT = 0.9  # of an intent's probability within the ellipse that is drawn, as in reports


@cache
def look() -> dict[str, Any]:
    """Colour scales, colours of robots, and how many standard deviations an intent's ellipse reaches."""
    stops = np.linspace(0.0, 1.0, 17)
    names = {"mean": VALUE_MAP, "std": STD_MAP}
    scales = {key: [to_hex(colour) for colour in colormaps[name](stops)] for key, name in names.items()}
    return {"scales": scales, "robots": [*AGENT_COLOURS], "radius": round(float(np.sqrt(-2 * np.log(1 - _INTENT))), 3)}
