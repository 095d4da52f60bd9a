"""`maipp plan`: all its files or none, in the units that the person uses, and one clear line for what is wrong."""

import csv
import dataclasses
import json
import re
from importlib.util import find_spec

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter

import maipp.viz
from maipp.belief import PriorSamples
from maipp.cli.plan import PlanFlags, report, run
from maipp.engine.episode import replay
from maipp.engine.episode_io import read_episode
from maipp.errors import InputError
from maipp.results.foreseen import foreseen
from maipp.results.records import belief_of

SMALL = (("scenario.grid=8", "scenario.nodes=12", "scenario.neighbours=4"),)
REPORT = ["report.html"] if find_spec("plotly") else []
FILES = sorted(["episode.json", "measurements.csv", "mission.gif", "overview.png", "waypoints.csv", *REPORT])


def small(out, **flags):
    return PlanFlags(**({"planner": "random", "agents": 2, "budget": (1.0,), "settings": SMALL, "out": out} | flags))


@pytest.fixture(autouse=True)
def no_ffmpeg(monkeypatch):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))


@pytest.fixture
def raster(tmp_path):
    """A file of 6 x 11 values without coordinates, which --corners puts at x 100..200, y 40..90."""
    path = tmp_path / "depths.npy"
    np.save(path, np.add.outer(np.linspace(5, 20, 6), np.linspace(0, 10, 11)))
    return path


CORNERS = (100.0, 200.0, 40.0, 90.0)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.skipif(not REPORT, reason="without plotly there is no report")
def test_the_report_has_the_map_of_the_foresight_that_is_named(tmp_path):
    assert run(small(tmp_path / "out", animation=False, foresight="fitted")) == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    episode = read_episode(tmp_path / "out" / "episode.json")
    law = foreseen(episode, belief_of(episode), "fitted")
    error = np.sqrt(np.mean((law.mean - episode.truth)[episode.inside] ** 2))
    (told,) = re.findall(r"Map error, fitted</dt><dd><strong>([\d.]+)", page)
    assert float(told) == pytest.approx(error, rel=1e-2)  # three digits are shown


def test_a_foresight_that_cannot_be_drawn_is_refused(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="--foresight: no foresight 'clear' .*there are protocol, fitted, learned"):
        run(small(tmp_path / "out", foresight="clear"))
    monkeypatch.setattr("maipp.cli.plan.find_spec", lambda name: None)
    with pytest.raises(InputError, match="needs plotly"):
        run(small(tmp_path / "out", foresight="fitted"))


def test_a_survey_leaves_files_that_agree(tmp_path, capsys):
    out = tmp_path / "new" / "out"
    assert run(small(out, seed=3)) == 0
    assert names(out) == FILES
    episode = read_episode(out / "episode.json")
    assert (episode.planner, episode.seed, episode.scenario.agents) == ("random", 3, 2)
    assert replay(episode).trace == pytest.approx(episode.metrics.trace, rel=1e-6)
    assert replay(episode).rmse == pytest.approx(episode.metrics.rmse, rel=1e-6)
    with open(out / "measurements.csv", newline="") as file:
        assert len(list(csv.reader(file))) == 1 + sum(len(agent.measurement_y) for agent in episode.agents)
    printed = capsys.readouterr().out
    assert f"{episode.metrics.trace:.4g}" in printed and f"{episode.metrics.rmse:.4g}" in printed
    assert "prior samples" not in printed
    for name in FILES:
        assert f"wrote {out / name}" in printed
    report(dataclasses.replace(episode, prior=PriorSamples(np.zeros((7, 2)), np.zeros(7))), [])
    assert re.search(r"prior samples +7\b", capsys.readouterr().out)


def test_a_field_from_a_file_is_surveyed_in_its_units(tmp_path, raster):
    out = tmp_path / "out"
    flags = {"field": raster, "corners": CORNERS, "start": (120.0, 50.0), "threshold": 20.0, "animation": False}
    assert run(small(out, **flags)) == 0
    assert names(out) == [name for name in FILES if name != "mission.gif"]
    episode = read_episode(out / "episode.json")
    assert episode.scenario.extent == (1.0, 0.5)
    assert episode.scenario.start == pytest.approx((0.2, 0.1))
    assert episode.scenario.threshold == pytest.approx((20.0 - 5.0) / 25.0)
    with open(out / "measurements.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        x, y, value = float(row["x"]), float(row["y"]), float(row["value"])
        assert 100 <= x <= 200 and 40 <= y <= 90
        assert value == pytest.approx(5 + 15 * (y - 40) / 50 + 10 * (x - 100) / 100, abs=1e-3)
    with open(out / "waypoints.csv", newline="") as file:
        last = list(csv.DictReader(file))[-1]
    assert float(last["distance"]) == pytest.approx(100 * episode.agents[-1].distance, rel=1e-5)


def test_a_folder_in_use_gets_all_new_files_and_no_old_film(tmp_path):
    for name in ("mission.mp4", "episode.json", "notes.txt"):
        (tmp_path / name).write_text("old")
    run(small(tmp_path, animation=False))
    assert names(tmp_path) == sorted({*FILES, "notes.txt"} - {"mission.gif"})
    assert read_episode(tmp_path / "episode.json").planner == "random"


def page_data(path):
    """The data on a report's page."""
    return json.loads(path.read_text(encoding="utf-8").partition('id="data">')[2].partition("</script>")[0])


@pytest.mark.skipif(not REPORT, reason="plotly is not installed")
@pytest.mark.parametrize("planner", ["random", pytest.param("sga-rrt", marks=pytest.mark.slow)])
def test_the_report_is_of_the_survey_with_what_the_robots_told(tmp_path, planner):
    nodes = ("nodes=12",) if planner == "sga-rrt" else ()
    run(small(tmp_path, planner=planner, animation=False, settings=(SMALL[0] + nodes,)))
    data = page_data(tmp_path / "report.html")
    episode = read_episode(tmp_path / "episode.json")
    for robot, agent in zip(data["robots"], episode.agents, strict=True):
        np.testing.assert_allclose(robot["route"]["x"], agent.route[:, 0], atol=1e-4)
        np.testing.assert_allclose(robot["measured"]["y"], agent.measurement_x[:, 1], atol=1e-4)
    assert bool(data["told"]) == (planner == "sga-rrt")
    assert len(data["told"]) in (0, episode.decisions)
    for told in data["told"]:
        assert told["ellipse"] is None and len(told["places"]["x"]) <= 2
    assert any(told["places"]["x"] for told in data["told"]) == (planner == "sga-rrt")


def test_without_plotly_the_report_is_left_out_and_an_old_one_goes(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("maipp.cli.plan._has_plotly", lambda: False)
    (tmp_path / "report.html").write_text("old")
    assert run(small(tmp_path, animation=False)) == 0
    assert names(tmp_path) == [name for name in FILES if name not in ("mission.gif", "report.html")]
    assert "left out report.html: it needs plotly, pip install 'maipp[geo]'" in capsys.readouterr().out


def test_an_interrupted_survey_leaves_nothing(tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(maipp.viz, "save_overview", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run(small(tmp_path))
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ({"invert": True}, "--invert: .* give --field FILE"),
        ({"corners": CORNERS}, "--corners: .* give --field FILE"),
        ({"seed": -1}, "--seed: -1 is no seed"),
        ({"seed": 10**20}, "--seed: 1000"),
        ({"start": (2.0, 0.5)}, r"start: \(2.0, 0.5\) is outside the domain"),
        ({"planner": "no-such"}, "no planner 'no-such'"),
        ({"settings": (("spin=3",),)}, "spin"),
        ({"settings": (("scenario.obstacles=[[[0,0],[1,0],[1,1],[0,1]]]",),)}, "no room to start from"),
    ],
)
def test_bad_flags_are_named_before_anything_is_written(tmp_path, flags, message):
    with pytest.raises(InputError, match=message):
        run(small(tmp_path, **flags))
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ({"start": (20.0, 50.0)}, "--start: 20 50 is outside the field; give x from 100 to 200 and y from 40 to 90"),
        ({"low": 9.0, "high": 3.0}, "low must be below high"),
        ({"value": "depth"}, "leave out value"),
        ({"geographic": True, "corners": (0.0, 720.0, 0.0, 1.0)}, "said to be degrees, but x spans 720"),
    ],
)
def test_bad_flags_for_a_file_are_named(tmp_path, raster, flags, message):
    with pytest.raises(InputError, match=message):
        run(small(tmp_path / "out", **({"field": raster, "corners": CORNERS} | flags)))


def test_an_output_folder_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(InputError, match="taken: is a file; give a folder"):
        run(small(tmp_path / "taken"))
    assert (tmp_path / "taken").read_text() == "mine"


def test_a_planner_that_names_nan_is_told_with_what_is_unspent(tmp_path, capsys):
    """Its robots go 0.3 of 1 and are then stopped."""
    (tmp_path / "bad.py").write_text(
        "import jax.numpy as jnp\n"
        "from maipp.engine import Decision, Planner\n"
        "class NanWay(Planner):\n"
        "    def decide(self, key, observation, memory):\n"
        "        ahead = jnp.where(observation.position < 0.5, 0.3, -0.3) * jnp.array([1.0, 0.0])\n"
        "        first = observation.remaining == observation.budget\n"
        "        return Decision(jnp.where(first, observation.position + ahead, jnp.nan)[None], (), memory)\n",
        encoding="utf-8",
    )
    out, name = tmp_path / "out", f"{tmp_path / 'bad.py'}:NanWay"
    assert run(small(out, planner=name, animation=False)) == 0
    episode = read_episode(out / "episode.json")
    assert [agent.stopped_by for agent in episode.agents] == ["not-finite"] * 2
    assert episode.unspent == pytest.approx(0.7, abs=1e-5)
    captured = capsys.readouterr()
    assert re.search(r"budget unspent +0\.7 domain units, mean over the agents", captured.out)
    (warning,) = [line for line in captured.err.splitlines() if line]
    assert warning == (
        f"warning: {name}: of 2 agents the engine stopped 2 at a waypoint that is not a finite number; "
        "unspent budget 0.7 domain units, mean over the agents"
    )
