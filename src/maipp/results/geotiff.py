"""The map as a GeoTIFF, written with rasterio (the extra `maipp[geo]`)."""

import logging
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from maipp.errors import InputError
from maipp.results.field_map import FieldMap
from maipp.typing import Float

BANDS = ("mean", "std", "high_interest", "foreseen_mean", "foreseen_std")


def load_rasterio() -> Any:
    """The module rasterio. Raises `InputError` where it is missing."""
    try:
        import rasterio
        import rasterio.errors
    except ImportError:
        raise InputError("a map as GeoTIFF needs rasterio; install it with: pip install 'maipp[geo]'") from None
    logging.getLogger("rasterio").setLevel(logging.CRITICAL)  # it logs what it raises as well
    return rasterio


def bands(drawn: FieldMap) -> dict[str, Float[np.ndarray, "r c"]]:
    """The bands of the file by their names, in order."""
    values = (drawn.mean, drawn.std, drawn.interest, drawn.foreseen_mean, drawn.foreseen_std)
    return {name: band for name, band in zip(BANDS, values, strict=True) if band is not None}


def write_geotiff(path: str | os.PathLike[str], drawn: FieldMap, unit: str | None) -> None:
    """Write the map: float32, deflated, NaN where there is none. Raises `InputError` where it cannot be written."""
    rasterio = load_rasterio()
    layers = bands(drawn)
    rows, columns = drawn.mean.shape
    profile = {"driver": "GTiff", "dtype": "float32", "nodata": float("nan"), "compress": "deflate", "predictor": 3}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            with rasterio.open(
                Path(path),
                "w",
                width=columns,
                height=rows,
                count=len(layers),
                crs=None if drawn.crs.name is None else rasterio.crs.CRS.from_user_input(drawn.crs.name),
                transform=rasterio.Affine(drawn.cell[0], 0.0, drawn.west, 0.0, -drawn.cell[1], drawn.north),
                **profile,
            ) as file:
                file.update_tags(AREA_OR_POINT="Area")
                for number, (name, band) in enumerate(layers.items(), start=1):
                    file.write(band.astype(np.float32), number)
                    file.set_band_description(number, name)
                    if unit and name != "high_interest":
                        file.set_band_unit(number, unit)
    except rasterio.errors.RasterioError as error:
        raise InputError(f"{path}: the map cannot be written ({' '.join(str(error).split())[:200]})") from None
