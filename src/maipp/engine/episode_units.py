"""The coordinates and units in which a person meets a survey: those of the field's file, where there is one."""

import math
from dataclasses import dataclass

import numpy as np

from maipp.fields.raster import Mapping
from maipp.typing import Float


@dataclass(frozen=True)
class Units:
    """From domain units and normalised values to the file's, which `mapping` describes; without one nothing changes."""

    mapping: Mapping | None = None

    @property
    def x(self) -> str:
        """Name of the x coordinate."""
        return (self.mapping and self.mapping.x_name) or "x"

    @property
    def y(self) -> str:
        """Name of the y coordinate."""
        return (self.mapping and self.mapping.y_name) or "y"

    @property
    def value(self) -> str:
        """Name of the measured quantity."""
        return (self.mapping and self.mapping.value_name) or "value"

    @property
    def inverted(self) -> bool:
        """Whether low values are the interesting ones."""
        return self.mapping is not None and self.mapping.value_at_one < self.mapping.value_at_zero

    @property
    def aspect(self) -> float:
        """Length of a unit of y over that of a unit of x, as drawn in the domain's proportions."""
        scale_x, scale_y = self._scales
        return scale_x / scale_y

    @property
    def length_scale(self) -> float | None:
        """File units per domain unit along any path; None where x and y differ in it (degrees, stretched files)."""
        scale_x, scale_y = self._scales
        return scale_x if math.isclose(scale_x, scale_y, rel_tol=1e-9) else None

    def points(self, points: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
        """File coordinates of domain positions."""
        return np.asarray(points) if self.mapping is None else self.mapping.to_file_points(points)

    def values(self, values: Float[np.ndarray, "..."] | float) -> Float[np.ndarray, "..."]:
        """File values of normalised values."""
        return np.asarray(values) if self.mapping is None else self.mapping.to_file_values(values)

    def std(self, std: Float[np.ndarray, "..."] | float) -> Float[np.ndarray, "..."]:
        """Errors and standard deviations in the file's units."""
        return np.asarray(std) if self.mapping is None else self.mapping.to_file_std(std)

    @property
    def _scales(self) -> tuple[float, float]:
        """File units per domain unit along x and y."""
        if self.mapping is None:
            return 1.0, 1.0
        (size_x, size_y), (width, height) = self.mapping.size, self.mapping.domain
        return size_x / width, size_y / height
