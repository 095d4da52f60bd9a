"""Gridded fields in GeoTIFF files, read with rasterio (the extra `maipp[geo]`)."""

import logging
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from maipp.errors import InputError, first_line
from maipp.fields.raster_data import RasterData, gaps_in
from maipp.fields.raster_placed import refuse_extent, without_coordinates
from maipp.fields.raster_terms import MOST_CELLS, choose
from maipp.geo import PLANE, Crs, read_crs


def read_geotiff(
    path: Path, value: str | None, extent: Sequence[float] | None, fill: bool, own: Crs | None
) -> RasterData:
    """One band of a GeoTIFF; coordinates are those of the cells' centres, scale and offset of the band are applied.

    `own` stands in place of the file's reference system. Raises InputError where rasterio is missing, for grids that
    are rotated or sheared, for reference systems that nobody knows, and for damaged files.
    """
    try:
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning, RasterioError
    except ImportError:
        raise InputError(f"{path}: GeoTIFF needs rasterio; pip install 'maipp[geo]'") from None
    # GDAL logs what it raises as well; one line is enough.
    logging.getLogger("rasterio").setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with rasterio.open(path, driver="GTiff") as file:  # not what else GDAL reads, HDF5 among it
                if file.width * file.height > MOST_CELLS:
                    raise InputError(
                        f"{path}: {file.height} x {file.width} cells are too many; cut it to the area or coarsen it "
                        "(gdalwarp -te, gdal_translate -outsize)"
                    )
                band = _band(path, [name or "" for name in file.descriptions], value)
                values = file.read(band, masked=True)
                scale, offset = file.scales[band - 1], file.offsets[band - 1]
                name = file.descriptions[band - 1]
                transform, crs = file.transform, file.crs
    except RasterioError as error:
        raise InputError(f"{path}: not a GeoTIFF, or damaged ({first_line(error)})") from None
    if values.dtype.kind in "biuf":
        values = values.astype(np.float64) * scale + offset
    # Where gaps are refused the error shall name a cell, so they must show as such.
    data = values.filled(np.nan) if values.dtype.kind == "f" else values.data
    if crs is None and transform.is_identity:
        return without_coordinates(path, data, extent, fill, value_name=name)
    refuse_extent(path, extent)
    if abs(transform.b) + abs(transform.d) > 1e-9 * (abs(transform.a) + abs(transform.e)):
        raise InputError(f"{path}: the grid is rotated against its coordinates; straighten it with gdalwarp")
    rows, cols = data.shape
    x = transform.c + transform.a * (np.arange(cols) + 0.5)
    y = transform.f + transform.e * (np.arange(rows) + 0.5)
    if own is None:
        own = PLANE if crs is None else read_crs(_text(crs), str(path))
    names = ("longitude", "latitude") if own.geographic else ("x", "y")
    missing = gaps_in(data) if fill else None
    return RasterData(data, x, y, str(path), *names, name, own, missing)


def _band(path: Path, descriptions: list[str], value: str | None) -> int:
    """The number of the band, counting from 1: the only one, or the one named by description or number."""
    names = [name or str(number) for number, name in enumerate(descriptions, start=1)]
    if value is not None and value.isdecimal() and value not in names and 1 <= int(value) <= len(names):
        return int(value)
    return names.index(choose(names, value, f"{path}: ", "band")) + 1


def _text(crs: object) -> str:
    """`EPSG:code` where the system has one, else its WKT."""
    epsg = crs.to_epsg()  # type: ignore[attr-defined]
    return f"EPSG:{epsg}" if epsg is not None else crs.to_wkt()  # type: ignore[attr-defined]
