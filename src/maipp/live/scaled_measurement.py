"""A measurement as it is conditioned on."""

from typing import NamedTuple

LARGEST_VALUE = 1e4  # prior standard deviations; what float32 can work with


class ScaledMeasurement(NamedTuple):
    """A measurement in the order that measurements of a robot are conditioned in: by time, then what it says."""

    time: float  # the scenario's time
    robot: int
    x: float  # domain units
    y: float
    value: float  # standardised
    stray: bool = False  # it is what files and sensors say for no value, such as -9999
