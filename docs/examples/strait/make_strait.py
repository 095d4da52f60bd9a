"""Cut the files of this example from Matplotlib's sample data: python docs/examples/strait/make_strait.py

relief.npz is the relief of the Strait of Georgia in metres, on longitudes and latitudes; area-metres.geojson and
land-metres.geojson are the same place in metres (UTM zone 10 north): the window, and its land as no-go zones.
soundings.csv are what an older survey may have left: the relief at random places, with an error.
"""

import json
from pathlib import Path

import numpy as np
import pyproj
import shapely
from matplotlib.cbook import get_sample_data

from maipp.fields.raster import load_raster
from maipp.files import atomic_path, write_atomic
from maipp.surveys.raster_area import raster_polygons
from maipp.surveys.mission_file import RasterArea

HERE = Path(__file__).parent
WEST, EAST, SOUTH, NORTH = -125.0, -122.95, 48.85, 50.0  # degrees
SOUNDINGS, ERROR, SEED = 60, 10.0, 0  # how many, standard deviation (m), of their draw


def cut_relief(path: Path) -> None:
    """Write the window of the sample data: elevation in metres, below 0 under water."""
    with np.load(str(get_sample_data("topobathy.npz", asfileobj=False))) as file:
        elevation, longitude, latitude = file["topo"], file["longitude"] - 360.0, file["latitude"]
    columns, rows = (longitude >= WEST) & (longitude <= EAST), (latitude >= SOUTH) & (latitude <= NORTH)
    with atomic_path(path) as temporary:
        np.savez_compressed(
            temporary,
            elevation=elevation[rows][:, columns].astype(np.float32),
            longitude=longitude[columns],
            latitude=latitude[rows],
        )


def metric_files(relief: Path, folder: Path) -> None:
    """Write the window and its land as GeoJSON polygons in metres."""
    land = raster_polygons(RasterArea(relief, None, 0.0, False, str(relief)), load_raster(relief))
    with np.load(relief) as file:
        longitude, latitude = file["longitude"], file["latitude"]
    # A little smaller than the relief: in metres its borders are curved.
    window = shapely.box(longitude[0] + 0.02, latitude[0] + 0.02, longitude[-1] - 0.02, latitude[-1] - 0.02)
    to_metres = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32610", always_xy=True)

    def metric(polygon: shapely.Polygon) -> dict:
        projected = shapely.transform(polygon, to_metres.transform, interleaved=False)
        return json.loads(shapely.to_geojson(shapely.set_precision(projected, 1.0)))

    write_atomic(folder / "area-metres.geojson", json.dumps(metric(window)) + "\n")
    features = [{"type": "Feature", "properties": {}, "geometry": metric(polygon)} for polygon in land]
    write_atomic(folder / "land-metres.geojson", json.dumps({"type": "FeatureCollection", "features": features}) + "\n")


def soundings(relief: Path, path: Path) -> None:
    """Write the elevation at random cells under water, with an error."""
    with np.load(relief) as file:
        elevation, longitude, latitude = file["elevation"], file["longitude"], file["latitude"]
    rng = np.random.default_rng(SEED)
    chosen = rng.choice(np.argwhere(elevation < 0), SOUNDINGS, replace=False)
    lines = [
        f"{longitude[column]:.4f},{latitude[row]:.4f},{elevation[row, column] + ERROR * rng.normal():.1f}"
        for row, column in chosen
    ]
    write_atomic(path, "\n".join(["longitude,latitude,elevation", *lines]) + "\n")


if __name__ == "__main__":
    cut_relief(HERE / "relief.npz")
    metric_files(HERE / "relief.npz", HERE)
    soundings(HERE / "relief.npz", HERE / "soundings.csv")
