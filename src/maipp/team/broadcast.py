"""What robots told each other during a survey, on the host, for records and pictures."""

from typing import NamedTuple

import numpy as np

from maipp.typing import Float


class Broadcast(NamedTuple):
    """What one robot told the others at a decision; it stands until the robot decides anew."""

    agent: int
    time: float  # of the decision, the scenario's unit of time
    mean: Float[np.ndarray, "2"]  # of its intent, domain units; NaN where it told none
    covariance: Float[np.ndarray, "3"]  # of its intent: xx, xy, yy, squared domain units; NaN where it told none
    places: Float[np.ndarray, "h 2"]  # where it means to measure next, domain units
    place_times: Float[np.ndarray, " h"]  # and when; inf where it announces nothing
