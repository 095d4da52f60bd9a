"""The overview shows the record, all of it, and in the file's coordinates and units."""

import ast
import dataclasses
import inspect
import itertools
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import maipp.viz
from maipp.belief import PriorSamples
from maipp.errors import InputError
from maipp.scenario import Scenario
from maipp.viz.overview import draw_overview, save_overview
from maipp.viz.style import AGENT_COLOURS, agent_colour, agent_line


def maps_of(figure):
    return [axes for axes in figure.axes if axes.get_title(loc="left")]


def test_four_maps_show_every_route_and_measurement(episode):
    maps = maps_of(draw_overview(episode, dpi=40))
    assert [axes.get_title(loc="left") for axes in maps] == [
        "Ground truth",
        "Predicted mean",
        "High-interest area",
        "Predicted standard deviation",
    ]
    for axes in maps:
        drawn = [np.asarray(line.get_xydata()) for line in axes.lines]
        for agent in episode.agents:
            for points in (agent.route, agent.measurement_x, agent.route[-1:], agent.start[None]):
                assert any(np.array_equal(np.float32(line), points) for line in drawn)
        assert len(axes.patches) == len(episode.scenario.obstacles)


@pytest.mark.parametrize("count", [3, 2000])
def test_prior_samples_are_small_crosses_on_every_map(episode, mapping, count):
    x = np.random.default_rng(0).uniform(0, 0.5, (count, 2)).astype(np.float32)
    prior = PriorSamples(x, np.zeros(count, np.float32), np.full(count, 0.1, np.float32))
    there = dataclasses.replace(episode, prior=prior, reference=mapping)
    figure = draw_overview(there, dpi=40)
    for axes in maps_of(figure):
        (crosses,) = [line for line in axes.lines if line.get_marker() == "+"]
        np.testing.assert_allclose(np.asarray(crosses.get_xydata()), mapping.to_user(x))
        assert crosses.get_linestyle() == "None" and crosses.get_markersize() <= 4
    (legend,) = figure.legends
    assert "prior sample" in [text.get_text() for text in legend.get_texts()]
    assert any(f"measurements, {count} prior samples" in text.get_text() for text in figure.texts)
    (legend,) = draw_overview(episode, dpi=40).legends
    assert "prior sample" not in [text.get_text() for text in legend.get_texts()]


def test_truth_and_mean_share_one_colour_scale(episode):
    truth, mean, _, std = maps_of(draw_overview(episode, dpi=40))
    assert truth.images[0].get_clim() == mean.images[0].get_clim()
    assert std.images[0].get_clim()[0] == 0.0
    # Row 0 at the bottom, x along the columns.
    picture = truth.images[0]
    assert picture.origin == "lower"
    np.testing.assert_array_equal(picture.get_array(), episode.truth.reshape(9, 9).T)


def test_the_title_holds_planner_and_numbers(episode):
    words = " ".join(text.get_text() for text in draw_overview(episode, dpi=40).texts)
    for part in ("by-hand", "2 agents", "budget 0.8", f"Tr(P) = {episode.metrics.trace:.3g}", "RMSE = "):
        assert part in words


def test_a_mapped_survey_is_drawn_in_the_file_s_coordinates_and_units(episode, mapping):
    there = dataclasses.replace(episode, reference=mapping)
    figure = draw_overview(there, dpi=40)
    truth, mean, area, _ = maps_of(figure)
    for axes in (truth, mean, area):
        np.testing.assert_allclose([*axes.get_xlim(), *axes.get_ylim()], [10.0, 12.0, 60.0, 60.5])
        # One degree of x is half a domain unit, one of y a whole one.
        assert axes.get_aspect() == pytest.approx(2.0)
    assert (area.get_xlabel(), area.get_ylabel()) == ("longitude", "latitude")
    np.testing.assert_allclose(
        np.asarray(truth.images[0].get_array()), 30 - 20 * episode.truth.reshape(9, 9).T, rtol=1e-6
    )
    error = f"RMSE = {20 * episode.metrics.rmse:.3g}"
    assert any(error in text.get_text() for text in figure.texts)
    bars = [axes for axes in figure.axes if "temperature" in axes.get_ylabel()]
    assert len(bars) == 2


def test_the_map_has_the_domain_s_proportions(episode):
    figure = draw_overview(episode, dpi=40)
    figure.canvas.draw()
    for axes in maps_of(figure):
        box = axes.get_window_extent()
        assert box.width / box.height == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize("threshold", [-5.0, 5.0])
def test_areas_that_are_everything_or_nothing_can_be_drawn(episode, threshold):
    scenario = episode.scenario.replace(threshold=threshold)
    there = dataclasses.replace(episode, scenario=scenario)
    assert len(maps_of(draw_overview(there, dpi=40))) == 4


def test_the_picture_is_written_whole(episode, tmp_path):
    save_overview(episode, tmp_path / "overview.png")
    content = (tmp_path / "overview.png").read_bytes()
    assert content.startswith(b"\x89PNG") and content.rstrip().endswith(b"IEND\xaeB`\x82")
    with pytest.raises(InputError, match="cannot be written"):
        save_overview(episode, tmp_path / "missing" / "overview.png")
    assert [path.name for path in tmp_path.iterdir()] == ["overview.png"]


def test_agents_of_large_teams_look_different():
    assert len({(agent_colour(i), agent_line(i)) for i in range(3 * len(AGENT_COLOURS))}) == 3 * len(AGENT_COLOURS)


def test_nothing_here_touches_pyplot():
    for path in Path(maipp.viz.__path__[0]).glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                assert "pyplot" not in ast.unparse(node), path


def test_zones_that_touch_are_drawn_without_the_side_that_they_share():
    from matplotlib.figure import Figure

    from maipp.viz.maps import draw_obstacles

    halves = [[[x, 0.2], [x + 0.2, 0.2], [x + 0.2, 0.8], [x, 0.8]] for x in (0.3, 0.5)]
    drawn = SimpleNamespace(to_user=lambda points: points)
    episode: Any = SimpleNamespace(scenario=Scenario.create(agents=1, obstacles=halves), drawn=drawn)
    axes = Figure().add_subplot()
    inspect.unwrap(draw_obstacles)(axes, episode)  # the stand-in is no Episode, which runtime checks would ask for
    (patch,) = axes.patches
    ends = {
        tuple(sorted((tuple(a), tuple(b))))
        for a, b in itertools.pairwise(np.asarray(patch.get_path().vertices).tolist())
    }
    assert ((0.5, 0.2), (0.5, 0.8)) not in ends
    assert not any(a[0] == b[0] == 0.5 for a, b in ends)
