"""Areas and no-go zones as people draw them: files of many programs, GeoJSON and lists of positions.

Each reader gives a `Drawing`, the polygons as written with what the file says of them; `to_polygon` checks one, and
`water_of` makes of all that a file draws what may be entered.
"""

from maipp.surveys.shapes.drawing import Drawing, Rings
from maipp.surveys.shapes.geojson import polygons_in
from maipp.surveys.shapes.load import FORMATS, load_drawing
from maipp.surveys.shapes.rings import to_polygon
from maipp.surveys.shapes.water import Named, water_of

__all__ = ["FORMATS", "Drawing", "Named", "Rings", "load_drawing", "polygons_in", "to_polygon", "water_of"]
