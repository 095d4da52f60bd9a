"""GPX: tracks around a shore are areas."""

import gpxpy.gpx
import numpy as np
import pytest

from maipp.errors import InputError
from maipp.geo import WGS84
from maipp.surveys.shapes import load_drawing, to_polygon
from tests.shared.gpx_text import gpx_text, track

SHORE = [(13.3, 53.4), (13.33, 53.4), (13.33, 53.412), (13.3, 53.412)]


def load(folder, *tracks, **more):
    (folder / "a.gpx").write_text(gpx_text(*tracks, **more))
    return load_drawing(folder / "a.gpx")


def test_tracks_and_routes_are_closed_to_areas(tmp_path):
    route = gpxpy.gpx.GPXRoute(name="Island")
    route.points += [gpxpy.gpx.GPXRoutePoint(y, x) for x, y in SHORE]
    drawing = load(tmp_path, track("Lake", SHORE[:2], [*SHORE[2:], SHORE[0]]), routes=[route], waypoints=2)
    assert [(each.name, each.closed) for each in drawing.polygons] == [("Lake", None), ("Island", True)]
    assert all(to_polygon(each, WGS84).area == pytest.approx(0.03 * 0.012) for each in drawing.polygons)
    first, gap = drawing.notes
    assert "beside its polygons 2 waypoints" in first and "'Island': its ends lie apart" in gap


def test_loops_of_a_wandering_receiver_are_cut_off(tmp_path):
    rng = np.random.default_rng(5)
    around = np.concatenate([np.linspace(a, b, 200) for a, b in zip(SHORE, SHORE[1:] + SHORE[:1], strict=True)])
    wandering = around + rng.normal(0, 2e-5, around.shape)  # 2 m, steps of 10 m along and 3 m across
    drawing = load(tmp_path, track(None, [*wandering, *wandering[:5] + 1e-5]))
    assert any("crosses itself" in note for note in drawing.notes)
    assert to_polygon(drawing.polygons[0], WGS84).area == pytest.approx(0.03 * 0.012, rel=0.01)


def test_a_figure_of_eight_is_refused(tmp_path):
    (rings,) = load(tmp_path, track("eight", [SHORE[0], SHORE[2], SHORE[1], SHORE[3]])).polygons
    with pytest.raises(InputError, match="eight.*crosses or touches itself"):
        to_polygon(rings, WGS84)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("<gpx><wpt lat='1' lon='2'/></gpx>", "holds no polygon, only 1 waypoint"),
        ("<kml/>", "no GPX file"),
        ("<gpx><trk><trkseg><trkpt lat='x' lon='2'/></trkseg></trk></gpx>", "lon='2' and lat='x'; both must be"),
        ("<gpx><trk><trkseg><trkpt lat='1' lon='2'/></trkseg></trk></gpx>", "1 distinct positions"),
    ],
)
def test_what_is_wrong_is_one_line(text, problem, tmp_path):
    (tmp_path / "a.gpx").write_text(text)
    with pytest.raises(InputError) as error:
        for rings in load_drawing(tmp_path / "a.gpx").polygons:
            to_polygon(rings, WGS84)
    assert problem in str(error.value) and "\n" not in str(error.value)
