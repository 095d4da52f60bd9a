"""Planned routes: inside the area, within budget, in the user's coordinates and seconds."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
import shapely

from maipp.engine.episode_io import dump_episode, parse_episode
from maipp.errors import InputError
from maipp.surveys.expected_field import ExpectedField
from maipp.surveys.expected_mission import expected_mission
from maipp.surveys.routes import check_files, check_routes, minutes, route_plan, vertices
from tests.surveys.conftest import SQUARE, prepared_from

SEA = """
area: {type: Polygon, coordinates: [[[4,55],[14,55],[14,60],[4,60]], [[7,57],[7.5,57],[7.5,57.5]]]}
robots: [{start: [5, 56], speed: 2, budget_m: 1500000}]
measurement_spacing_m: 30000
kernel: {length_scale_m: 100000, mean: 10, std: 4}
planner: shared-greedy
scenario: {grid: 10, nodes: 40, neighbours: 6}
"""


@pytest.fixture(scope="module")
def planned():
    prepared = prepared_from(SQUARE)
    return prepared, expected_mission(prepared)


def test_routes_are_metres_and_seconds_and_keep_the_budgets(planned):
    prepared, episode = planned
    plan = route_plan(prepared, episode)
    assert [route.name for route in plan.routes] == ["one", "two"] and not plan.geographic
    land = shapely.union_all([shapely.Polygon(zone) for zone in plan.no_go])
    for robot, route, agent in zip(prepared.survey.robots, plan.routes, episode.agents, strict=True):
        lengths = np.hypot(*np.diff(route.points, axis=0).T)
        assert lengths.sum() <= robot.budget_m * 1.0001
        assert route.times[0] == 0 and route.speed == robot.speed
        # Seconds follow from metres and metres per second.
        assert np.diff(route.times) == pytest.approx(lengths / robot.speed, rel=1e-3, abs=0.05)
        assert route.times[-1] / 60 == pytest.approx(minutes(prepared, agent))
        line = shapely.linestrings(route.points)
        assert shapely.Polygon(plan.area).covers(line) and not land.intersects(line)
        assert len(route.measurements) == len(agent.measurement_y) == int(robot.budget_m / 300 + 1e-3)


def test_the_record_reads_back_in_metres_and_units(planned):
    prepared, episode = planned
    again = parse_episode(dump_episode(episode))
    assert again.reference == episode.reference and again.geo.value_name == "salt (g/L)"
    assert again.geo.to_user(again.agents[0].route)[0] == pytest.approx([0.5, 0.5], abs=2)
    assert prepared.frame.to_user_values(0.0) == again.geo.to_user_values(0.0) == 10.0


def test_the_same_seed_gives_the_same_routes(planned):
    prepared, episode = planned
    again = expected_mission(prepared, seed=0)
    assert all((a.route == b.route).all() for a, b in zip(episode.agents, again.agents, strict=True))


def test_a_route_that_leaves_the_area_is_refused(planned):
    prepared, episode = planned
    agent = episode.agents[0]
    through = np.vstack([agent.route[:1], np.array([[0.99, 0.01]], agent.route.dtype)])  # across the zone
    stray = dataclasses.replace(agent, route=through, route_time=agent.route_time[:2])
    wrong = dataclasses.replace(episode, agents=(stray, *episode.agents[1:]))
    with pytest.raises(InputError, match=r"mission.yaml:\d+: planner: shared-greedy led one out of the area"):
        check_routes(prepared, wrong)
    check_routes(prepared, episode)


def test_long_legs_in_degrees_get_vertices_so_that_both_lines_agree(planned):
    _, episode = planned
    prepared = prepared_from(SEA)
    agent = dataclasses.replace(
        episode.agents[0],
        route=np.array([[0.1, 0.5], [0.9, 0.5], [0.9, 0.6]], np.float32),
        route_time=np.array([0.0, 0.8, 0.9], np.float32),
    )
    points, times = vertices(prepared, agent)
    assert len(points) > 6 and (np.diff(times) > 0).all()
    dense = prepared.frame.to_plane(shapely.get_coordinates(shapely.segmentize(shapely.linestrings(points), 0.01)))
    straight = shapely.linestrings(agent.route.astype(float) * prepared.frame.metres_per_unit + prepared.frame.origin)
    assert shapely.distance(straight, shapely.points(dense)).max() < prepared.margin / 2
    assert prepared.margin > 0


def test_the_expected_field_is_the_posterior_mean():
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import Matern

    prepared = prepared_from(SQUARE)
    rng = np.random.default_rng(3)
    x, y, at = rng.random((20, 2)), rng.normal(size=20), rng.random((50, 2))
    scenario = prepared.scenario
    kernel = Matern(length_scale=scenario.length_scale, length_scale_bounds="fixed", nu=1.5)
    model = GaussianProcessRegressor(kernel, alpha=scenario.noise, optimizer=None)  # pyright: ignore[reportArgumentType]
    reference = model.fit(x, y).predict(at)
    found = ExpectedField.of(scenario, x, y, noise=scenario.noise)(jnp.asarray(at, jnp.float32))
    assert np.asarray(found) == pytest.approx(reference, abs=2e-4)
    empty = ExpectedField.of(scenario, np.zeros((0, 2)), np.zeros(0), noise=1e-6)
    assert (np.asarray(empty(jnp.asarray(at))) == 0).all()


def test_what_files_cannot_hold_is_told_before_planning():
    text = SEA.replace("[[4,55],[14,55],[14,60],[4,60]]", "[[178,55],[-178,55],[-178,57],[178,57]]")
    text = text.replace(", [[7,57],[7.5,57],[7.5,57.5]]", "").replace("[5, 56]", "[179.9, 56]")
    prepared = prepared_from(text)
    assert prepared.region.area > 0 and prepared.frame.size[0] < 300_000
    with pytest.raises(InputError, match="mission.yaml: area: crosses the 180th meridian"):
        check_files(prepared)
