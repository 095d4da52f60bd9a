"""The standardised problem: lengths in domain units, values as the prior has them, every oddity told."""

import numpy as np
import pytest
import shapely

from maipp.errors import InputError
from maipp.roadmap import Obstacles, sample_roadmaps
from maipp.roadmap.bridges import is_joined
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import parse_survey
from maipp.surveys.template import TEMPLATE
from tests.surveys.conftest import SQUARE, prepared_from


def changed(*pairs):
    text = SQUARE
    for before, after in pairs:
        assert before in text
        text = text.replace(before, after)
    return text


def test_lengths_are_in_longest_sides_and_the_fastest_robot_has_speed_1(square):
    scenario = square.scenario
    assert scenario.extent == (1.0, 1.0) and square.frame.metres_per_unit == 1000
    assert scenario.budgets == pytest.approx((1.5, 1.2)) and scenario.speeds == (1.0, 0.5)
    assert scenario.measurement_interval == pytest.approx(0.3) and scenario.length_scale == pytest.approx(0.3)
    assert scenario.field_family == "any"  # nobody knows that a real place looks like the experiment's fields
    assert square.seconds_per_time == 500  # 1 km at 2 m/s
    assert square.names == ("one", "two") and scenario.comm_range is None
    assert (scenario.grid, scenario.nodes, scenario.neighbours) == (10, 40, 6)


def test_values_are_in_prior_standard_deviations(square):
    assert square.scenario.threshold == 0.5 and square.scenario.signal_variance == 1.0
    assert square.scenario.noise == pytest.approx(0.01) and square.scenario.beta == 1.0
    below = prepared_from(changed(("threshold: 12", "threshold: 12\nbelow: true")))
    assert below.scenario.threshold == -0.5 and below.frame.to_user_values(-0.5) == 12.0


def test_a_threshold_far_above_the_mean_leaves_the_unknown_of_interest():
    prepared = prepared_from(changed(("threshold: 12", "threshold: 18")))
    # The prior's upper confidence bound is 0 + beta * 1.
    assert prepared.scenario.beta > prepared.scenario.threshold == 2.0
    rare = prepared_from(changed(("threshold: 12", "threshold: 26")))
    assert any("hardly any place" in warning for warning in rare.warnings)
    with pytest.raises(InputError, match=r"mission.yaml:\d+: threshold: 1e\+06 lies 2.5e\+05 prior standard"):
        prepared_from(changed(("threshold: 12", "threshold: 1000000")))


def test_without_a_threshold_every_place_is_of_interest():
    prepared = prepared_from(changed(("threshold: 12\n", "")))
    assert prepared.scenario.threshold < -3


def test_zones_and_islands_are_obstacles(square):
    obstacles = Obstacles(square.scenario.obstacles)
    points = np.array([[0.25, 0.25], [0.65, 0.65], [0.45, 0.45], [0.9, 0.1], [0.001, 0.5]])
    assert obstacles.free(points).tolist() == [False, False, True, True, False]
    assert obstacles.free(np.asarray(square.scenario.starts, np.float32).astype(np.float64)).all()
    assert len(square.no_go) == 2 and square.area.shape == (4, 2)


def test_what_is_assumed_is_told():
    warning = prepared_from(changed(("kernel: {length_scale_m: 300, mean: 10, std: 4}\n", ""))).warnings[-1]
    assert "length scale" in warning and "standard deviation 6 g/L" in warning and "mean 9.6 g/L" in warning
    kept = prepared_from(changed(("mean: 10, std: 4", "mean: 10")))
    assert kept.frame.mean == 10 and kept.frame.std == 6


def test_a_length_scale_out_of_proportion_is_told():
    prepared = prepared_from(changed(("length_scale_m: 300", "length_scale_m: 1")))
    assert prepared.scenario.length_scale == 0.02
    assert any("does not fit an area 1000 m long; planned with 20 m" in warning for warning in prepared.warnings)


@pytest.mark.parametrize(
    ("pairs", "problem"),
    [
        ([("start: [0, 0]", "start: [-900, 0]")], "mission.yaml:7: robots[0].start: (-900.0, 0.0) lies 900 m outside"),
        ([("start: [0, 0]", "start: [250, 250]")], "lies 50 m deep inside a no-go zone"),
        ([("spacing_m: 300", "spacing_m: 0.1")], "mission.yaml:9: measurement_spacing_m: 0.1 m means 15000 measurem"),
        ([("planner: shared-greedy", "planner: gredy")], "mission.yaml:15: planner: no planner 'gredy' (did you mean"),
        ([("grid: 10", "grid: 1")], "mission.yaml:16: scenario.grid: 1 is not a whole number >= 2"),
        ([("neighbours: 6", "neighbours: 60")], "mission.yaml:16: scenario.neighbours: 60 is not below nodes (40)"),
        ([("metres: true", "clearance_m: 600\nmetres: true")], "nothing of the area keeps 600 m clear"),
        ([("[300,0],[300,500],[200,500]", "[300,500],[300,0],[200,500]")], "no_go[0]: crosses or touches itself"),
    ],
)
def test_what_cannot_be_planned_is_one_line(pairs, problem):
    with pytest.raises(InputError) as error:
        prepared_from(changed(*pairs)).make_planner()
    assert problem in str(error.value) and "\n" not in str(error.value)


def test_a_zone_elsewhere_is_told():
    prepared = prepared_from(changed(("[[[200,0],[300,0]", "[[[9000,0],[9900,0],[9900,99]], [[200,0],[300,0]")))
    assert "mission.yaml:5: no_go[0]: this no-go zone lies outside the area" in prepared.warnings[0]


def test_degrees_swapped_in_a_start_are_noticed():
    text = TEMPLATE.replace("start: [4.7302, 52.2402]", "start: [52.2402, 4.7302]")
    with pytest.raises(InputError, match=r"robots\[0\].start: lies outside the area, but with its two numbers swapped"):
        prepare(parse_survey(text))


def test_the_same_place_in_degrees_and_in_metres_is_the_same_problem():
    degrees = prepare(parse_survey(TEMPLATE))
    frame = degrees.frame
    corners = [frame.to_plane(np.array(p)).tolist() for p in ([4.73, 52.24], [4.746, 52.24], [4.748, 52.246])]
    corners += [frame.to_plane(np.array(p)).tolist() for p in ([4.74, 52.25], [4.73, 52.248])]
    zone = [[4.737, 52.244], [4.739, 52.244], [4.739, 52.2455], [4.737, 52.2455]]
    text = TEMPLATE.replace("# metres: false", "metres: true")
    for line in TEMPLATE.splitlines():
        if line.startswith("area:"):
            text = text.replace(line, f"area: {corners}")
        if line.startswith("  - [["):
            text = text.replace(line, f"  - {frame.to_plane(np.array(zone)).tolist()}")
    for start in ([4.7302, 52.2402], [4.7306, 52.2402]):
        text = text.replace(str(start), str(frame.to_plane(np.array(start)).tolist()))
    metres = prepare(parse_survey(text))
    assert metres.scenario.extent == pytest.approx(degrees.scenario.extent, abs=1e-4)
    assert metres.scenario.budgets == pytest.approx(degrees.scenario.budgets, rel=1e-4)
    assert np.array(metres.scenario.starts) == pytest.approx(np.array(degrees.scenario.starts), abs=1e-3)
    assert metres.region.area == pytest.approx(degrees.region.area, rel=1e-3)
    assert frame.to_user(np.array(degrees.scenario.starts)[0]) == pytest.approx([4.7302, 52.2402], abs=1e-4)


ISLAND = "[[600,600],[700,600],[700,700],[600,700]]"


@pytest.mark.parametrize("width", [0.03, 0.25, 1.0])
def test_roadmaps_of_narrow_areas_hang_together(width):
    far, near = 1000 * (1 - width), 1000 * width
    band = f"[[0,0],[{near},0],[1000,{far}],[1000,1000],[{far},1000],[0,{near}]]"
    text = changed(
        (f"[[[0,0],[1000,0],[1000,1000],[0,1000]], {ISLAND}]", f"[{band}]"),
        ("no_go: [[[200,0],[300,0],[300,500],[200,500]]]\n", ""),
        ("start: [50, 50]", "start: [10, 10]"),
        ("scenario: {grid: 10, nodes: 40, neighbours: 6}\n", ""),
    )
    scenario = prepared_from(text).scenario
    inside = Obstacles(scenario.obstacles).free(
        np.stack(np.meshgrid(*[np.linspace(0, 1, scenario.grid)] * 2), axis=-1).reshape(-1, 2)
    )
    assert inside.sum() >= (100 if width < 0.1 else 150)
    roadmap = sample_roadmaps(
        np.random.default_rng(0),
        np.array(scenario.starts),
        nodes=scenario.nodes,
        neighbours=scenario.neighbours,
        extent=scenario.extent,
        obstacles=scenario.obstacles,
    )
    assert all(map(is_joined, np.asarray(roadmap.neighbours), np.asarray(roadmap.reachable)))


def test_borders_of_many_vertices_are_thinned_for_autopilots(tmp_path):
    angle = np.linspace(0, 2 * np.pi, 900, endpoint=False)
    radius = 500 + 3 * np.sin(40 * angle)
    ring = np.round(np.stack([500 + radius * np.cos(angle), 500 + radius * np.sin(angle)], axis=-1), 3).tolist()
    text = changed(
        (f"{{type: Polygon, coordinates: [[[0,0],[1000,0],[1000,1000],[0,1000]], {ISLAND}]}}", str(ring)),
        ("start: [0, 0]", "start: [500, 500]"),
        ("start: [50, 50]", "start: [500, 500]"),
        ("[200,0]", "[200,100]"),
    )
    prepared = prepared_from(text)
    assert len(prepared.area) < 400
    assert shapely.Polygon(prepared.area).buffer(1e-6).covers(prepared.region)


def test_a_zone_across_an_ocean_is_cut_to_what_is_near():
    zone = "  - [[4.7370, 52.2440], [160.0, 52.2440], [160.0, 80.0], [4.7370, 80.0]]"
    line = next(line for line in TEMPLATE.splitlines() if line.startswith("  - [[4.7370"))
    prepared = prepare(parse_survey(TEMPLATE.replace(line, zone)))
    (border,) = prepared.no_go
    assert len(border) < 20 and border[:, 0].max() < 4.8
    east = prepared.frame.to_domain(np.array([4.745, 52.246]))
    assert not Obstacles(prepared.scenario.obstacles).free(east[None])[0]
