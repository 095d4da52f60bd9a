from pathlib import Path

import numpy as np
import pytest

from maipp.errors import InputError
from maipp.route_files import Route, RoutePlan, VehicleSettings, left_out, write_route_files

GOLDEN = Path(__file__).with_name("golden")


def named(folder):
    return sorted(path.name for path in folder.iterdir())


def test_all_formats_are_written(plan, tmp_path):
    written = write_route_files(plan, tmp_path / "new" / "missions")
    stems = "Nord_Süd 1", "south & east"
    names = [f"{stem}.{suffix}" for suffix in ("plan", "waypoints") for stem in stems]
    names += ["routes.gpx", "routes.geojson", "waypoints.csv"]
    assert written == [tmp_path / "new" / "missions" / name for name in names]
    assert named(tmp_path / "new" / "missions") == sorted(names)
    for path in written:
        if (GOLDEN / path.name).exists():
            assert path.read_bytes() == (GOLDEN / path.name).read_bytes()
    assert left_out(plan) == {}


def test_in_metres_only_what_makes_sense(plan_in_metres, tmp_path):
    written = write_route_files(plan_in_metres, tmp_path)
    assert [path.name for path in written] == ["routes-in-metres.json", "waypoints.csv"]
    assert written[0].read_bytes() == (GOLDEN / "routes-in-metres.json").read_bytes()
    missing = left_out(plan_in_metres)
    assert list(missing) == ["plan", "waypoints", "gpx", "geojson"] and all(
        "longitudes" in why for why in missing.values()
    )
    assert left_out(plan_in_metres, ["csv"]) == {}


def test_nothing_left_to_write_is_an_error(plan, plan_in_metres, tmp_path):
    with pytest.raises(InputError, match=r"no route file can be written \(gpx: GPX is in longitudes"):
        write_route_files(plan_in_metres, tmp_path / "new", formats=["gpx"])
    with pytest.raises(InputError, match="no route file can be written"):
        write_route_files(plan, tmp_path / "new", formats=[])
    assert not (tmp_path / "new").exists()


def test_names_that_clash_get_files_of_their_own(plan, tmp_path):
    routes = tuple(Route(name, np.array([[4.2, 51.9]]), np.zeros(1), 1.0) for name in ("a/b", "a:b", "A?b"))
    again = RoutePlan("", routes, plan.area, (), True)
    written = write_route_files(again, tmp_path, formats=["plan"], vehicle=VehicleSettings("rover"))
    assert [path.name for path in written] == ["a_b.plan", "a_b-2.plan", "A_b-3.plan"]


@pytest.mark.parametrize("broken", ["gpx_file", "waypoints_csv_file", "write_atomic"])
def test_all_or_nothing(plan, tmp_path, monkeypatch, broken):
    (tmp_path / "routes.gpx").write_text("of last week")
    calls = []

    def fail(*arguments):
        calls.append(arguments)
        if broken != "write_atomic" or len(calls) == 4:  # the fourth of seven files
            raise OSError("disk full")
        Path(arguments[0]).write_text(arguments[1])

    monkeypatch.setattr(writer, broken, fail)
    with pytest.raises(OSError, match="disk full"):
        write_route_files(plan, tmp_path)
    assert named(tmp_path) == ["routes.gpx"] and (tmp_path / "routes.gpx").read_text() == "of last week"


def test_files_of_robots_that_are_gone_go_and_others_stay(plan, tmp_path):
    write_route_files(plan, tmp_path)
    (tmp_path / "own.plan").write_text("{}")
    fewer = RoutePlan("", plan.routes[:1], plan.area, (), True)
    write_route_files(fewer, tmp_path)
    assert not [name for name in named(tmp_path) if name.startswith("south")] and "own.plan" in named(tmp_path)


def test_a_folder_that_is_a_file_is_told(plan, tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="is a file; give a folder"):
        write_route_files(plan, tmp_path / "taken")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"formats": ["kml"]}, "mission format 'kml' is not known; give plan, waypoints, gpx, geojson, csv"),
        ({"vehicle": "submarine"}, "vehicle 'submarine' is not known"),
        ({"vehicle": "copter"}, "needs an altitude"),
        ({"vehicle": VehicleSettings("copter", altitude=20.0), "altitude": 30.0}, "altitude is given twice"),
    ],
)
def test_wrong_choices_are_told(plan, tmp_path, options, told):
    with pytest.raises(InputError, match=told):
        write_route_files(plan, tmp_path / "new", **options)
    assert not (tmp_path / "new").exists()


def test_a_copter_flies_at_the_altitude(plan, tmp_path):
    path, *_ = write_route_files(plan, tmp_path, formats=["plan"], vehicle="copter", altitude=25.0)
    assert path.read_text(encoding="utf-8").count('"Altitude": 25.0') == 4


def test_the_plan_s_numbers_are_its_own_after_writing(plan, tmp_path):
    before = plan.routes[0].points.copy()
    write_route_files(plan, tmp_path)
    np.testing.assert_array_equal(plan.routes[0].points, before)
