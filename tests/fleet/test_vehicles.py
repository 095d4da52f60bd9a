"""Vehicles by name: ours, those of other packages, and the options of the simulated one."""

import sys
import textwrap
from dataclasses import replace
from importlib.metadata import EntryPoint
from typing import Any, cast

import jax.numpy as jnp
import numpy as np
import pytest

from maipp import extensions
from maipp.errors import InputError
from maipp.fleet import vehicles
from maipp.fleet.clock import VirtualClock
from maipp.fleet.simulated import Simulated
from maipp.fleet.simulation import OPTIONS, make, seed_of, truth
from maipp.fleet.vehicle import Fix, Vehicle
from maipp.live.team import TeamSurvey
from maipp.scenario import Scenario
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import parse_survey
from tests.surveys.conftest import SQUARE

SCENARIO = Scenario(agents=2, budget=1.2, start=(0.5, 0.5), grid=8, nodes=16, neighbours=5)
POINTS = np.array([[0.1, 0.2], [0.7, 0.4], [0.5, 0.9]])

OTHER = """
class Canoe:
    def __init__(self, place, options):
        self.place, self.options = place, options

    def where(self):
        from maipp.fleet.vehicle import Fix

        return Fix(0.0, (1.0, 2.0))

    def go(self, waypoints, measure, *, home=False): ...
    def hold(self): ...
    def poll(self): return []
    def close(self): ...


def make(place, options):
    return Canoe(place, options)


broken_number = 3
"""


@pytest.fixture(scope="module")
def survey():
    return cast(TeamSurvey, TeamSurvey.from_scenario(SCENARIO, "random", {}, seed=3))


@pytest.fixture(scope="module")
def mission():
    return prepare(parse_survey(SQUARE, source="mission.yaml"))


@pytest.fixture
def place(survey, tmp_path):
    return vehicles.VehicleContext("robot2", survey, None, tmp_path, VirtualClock(), 3, print)


@pytest.fixture
def real_place(mission, tmp_path):
    """A place with metres, salt in g/L (mean 10, std 4), an epoch, and robots of different speeds."""
    survey = cast(TeamSurvey, TeamSurvey.from_prepared(mission, seed=5, epoch=1000.0))
    return vehicles.VehicleContext("two", survey, mission, tmp_path, VirtualClock(1000.0), 5, print)


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A distribution of someone else, as an installer leaves it."""
    folder = tmp_path / "site"
    info = folder / "canoes-1.0.dist-info"
    info.mkdir(parents=True)
    (folder / "canoes.py").write_text(textwrap.dedent(OTHER))
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: canoes\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[maipp.vehicles]\ncanoe = canoes:make\nlost = canoes:nothing\ngone = no_such_module:make\n"
        "number = canoes:broken_number\nsimulated = canoes:make\n"
    )
    monkeypatch.syspath_prepend(str(folder))
    yield folder
    sys.modules.pop("canoes", None)


def test_a_vehicle_of_another_package_is_found(installed, place):
    assert vehicles.names() == ["canoe", "gone", "lines", "lost", "mavlink", "number", "simulated"]
    canoe = vehicles.maker_of("canoe")(place, {"paddle": "2"})
    assert isinstance(canoe, Vehicle) and canoe.where() == Fix(0.0, (1.0, 2.0))
    assert (canoe.place, canoe.options) == (place, {"paddle": "2"})  # pyright: ignore[reportAttributeAccessIssue]


def test_nobody_takes_the_name_of_one_of_ours(installed):
    assert vehicles.maker_of("simulated") is make


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("lost", "--vehicle lost: canoes:nothing cannot be loaded: .*nothing"),
        ("gone", "--vehicle gone: no_such_module:make cannot be loaded: No module named 'no_such_module'"),
        ("number", "--vehicle number: canoes:broken_number is no function that makes a vehicle"),
        ("submarine", "--vehicle submarine: not known; there is canoe, gone, lines"),
    ],
)
def test_one_that_cannot_be_loaded_is_told_in_one_line(installed, name, problem):
    with pytest.raises(InputError, match=problem) as error:
        vehicles.maker_of(name)
    assert "\n" not in str(error.value)


def test_one_that_makes_no_vehicle_is_told(installed, place):
    (installed / "canoes.py").write_text("def make(place, options): return 3\n")
    sys.modules.pop("canoes", None)
    with pytest.raises(InputError, match="--vehicle canoe: canoes:make made an int, which is no vehicle"):
        vehicles.maker_of("canoe")(place, {})


def test_a_package_that_fails_to_make_one_is_told(installed, place):
    (installed / "canoes.py").write_text("def make(place, options): raise RuntimeError('two\\nlines')\n")
    sys.modules.pop("canoes", None)
    with pytest.raises(InputError, match="--vehicle canoe: canoes:make failed: RuntimeError: two lines"):
        vehicles.maker_of("canoe")(place, {})


def test_two_packages_of_one_name_are_told(monkeypatch):
    points = [EntryPoint("canoe", "a:make", extensions.VEHICLES), EntryPoint("canoe", "b:make", extensions.VEHICLES)]
    monkeypatch.setattr(extensions, "entry_points", lambda group: points)
    with pytest.raises(InputError, match="--vehicle canoe: two packages bring one: a:make, b:make; remove one"):
        vehicles.maker_of("canoe")


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"colour": "red"}, "--with colour: not known; there is raster, value, field"),
        ({"bad": "often"}, "--with bad=often: not as it should be; give one such as bad=0.0"),
        ({"drift": "1"}, "--with drift=1: not as it should be; give one such as drift=0.0,0.0"),
        ({"bad": "2"}, "--with bad: 2.0 is no chance"),
        ({"noise": "nan"}, "--with noise: nan is no standard deviation"),
        ({"speed": "-1"}, "--with speed: -1 is no speed"),
        ({"speed": "nan"}, "--with speed: nan is no speed"),
        ({"field": "x"}, "--with field=x: not as it should be; give a whole number"),
        ({"field": "-1"}, "--with field: -1 is no seed"),
        ({"field": "1", "raster": "a.tif"}, "--with field=1: there is a raster too"),
        ({"raster": "a.tif"}, "--with raster=a.tif: a scenario file has no place"),
        ({"value": "depth"}, "--with value=depth: of no map"),
    ],
)
def test_options_that_make_no_sense_are_refused(place, options, problem):
    with pytest.raises(InputError, match=problem):
        make(place, options)


def test_the_truth_of_a_scenario_is_its_own_or_a_draw_of_its_kernel(place, survey):
    own = truth(place)(POINTS)
    assert own == pytest.approx(np.asarray(survey.world.mission.field(jnp.asarray(POINTS, jnp.float32))), abs=1e-6)
    one, again, two = (truth(place, number=number)(POINTS) for number in ("1", "1", "2"))
    assert (one == again).all() and not np.allclose(one, two) and not np.allclose(one, own)


def test_a_mission_is_drawn_from_its_kernel_the_same_for_all_robots(real_place):
    one, two = (make(replace(real_place, robot=name), {"noise": "0"}) for name in ("one", "two"))
    assert (one._field(POINTS) == two._field(POINTS)).all()
    start = two.where()
    two.go([(start.position[0] + 100.0, start.position[1])], [(start.position[0] + 50.0, start.position[1])])
    real_place.clock.time += 100.0  # at 1 m/s
    reading, reached = cast(list[Any], two.poll())
    assert reached.time == pytest.approx(1100.0, abs=0.01) and reached.travelled == pytest.approx(100.0, abs=0.001)
    assert reading.time == pytest.approx(1050.0, abs=0.01)
    units, survey = real_place.survey.setup.units, real_place.survey
    inner = np.array([units.position("", reading.position)])
    assert reading.value == pytest.approx(10 + 4 * two._field(inner)[0], abs=1e-4)
    assert survey.names == ("one", "two")


def test_a_speed_of_its_own(real_place):
    boat = make(real_place, {"speed": "0.5", "noise": "0"})
    start = boat.where().position
    boat.go([(start[0] + 100.0, start[1])], [])
    real_place.clock.time += 100.0
    assert boat.where().travelled == pytest.approx(50.0, abs=0.001)


def test_the_noise_left_out_is_the_mission_s(place, real_place):
    assert make(place, {})._errors.value == pytest.approx(SCENARIO.noise**0.5)
    assert make(real_place, {})._errors.value == pytest.approx(0.4)  # g/L, as the file says
    assert isinstance(make(place, {key: "0" for key in ("noise", "bad", "position")}), Simulated)


def test_errors_differ_between_robots_whatever_their_names_end_in():
    assert len({seed_of(name, seed) for name in ("north-boat-1", "south-boat-1", "a") for seed in (0, 1)}) == 6


def test_every_option_is_named_in_the_maker_s_docstring():
    assert all(key in (make.__doc__ or "") for key in OPTIONS)
