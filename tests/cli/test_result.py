"""`maipp result`: a survey's map, samples, report and numbers, from its journal while it runs, and from a record."""

import csv
import dataclasses
import json
from importlib.util import find_spec

import numpy as np
import pytest

from maipp.cli.main import main
from maipp.engine.episode import Episode
from maipp.engine.episode_io import write_episode
from maipp.geo import GeoReference
from maipp.live import LiveSurvey
from maipp.live.journal import Journal, read_journal
from maipp.surveys.standardise import prepare
from maipp.surveys.survey_io import load_survey
from tests.viz import conftest as by_hand

rasterio = pytest.importorskip("rasterio")
pyproj = pytest.importorskip("pyproj")

# 1 km in the metres of UTM zone 33 with an island and a no-go zone; an old sample far from all that is measured.
MISSION = """
name: bay
crs: EPSG:25833
area:
  type: Polygon
  coordinates:
    - [[390000,5820000],[391000,5820000],[391000,5821000],[390000,5821000]]
    - [[390600,5820600],[390700,5820600],[390700,5820700],[390600,5820700]]
no_go: [[[390200,5820000],[390300,5820000],[390300,5820500],[390200,5820500]]]
robots:
  - {name: one, start: [390010, 5820010], speed: 2, budget_m: 1500, reserve_m: 100, end: start}
  - {name: two, start: [390050, 5820050], speed: 1, budget_m: 1200, end: start}
measurement_spacing_m: 300
quantity: salt
unit: g/L
threshold: 12
samples: old.csv
kernel: {length_scale_m: 300, mean: 10, std: 4}
noise: 0.4
planner: shared-greedy
scenario: {grid: 10, nodes: 40, neighbours: 6}
"""
EPOCH = 1_780_000_000.0
# Of each robot: place (m from the area's corner), value. The third is withdrawn, the spike and -9999 do not count.
ONE = [((150, 300), 13.0), ((120, 450), 12.5), ((150, 600), 11.0), ((300, 700), 480.0), ((20, 12), 9.5)]
TWO = [((500, 300), 8.0), ((800, 500), -9999.0)]


@pytest.fixture(autouse=True)
def devices_are_set(monkeypatch):
    monkeypatch.setattr("maipp.devices._configured", True)  # JAX is running already


def degrees(place):
    there = pyproj.Transformer.from_crs(25833, 4326, always_xy=True)
    return list(there.transform(390000 + place[0], 5820000 + place[1]))


def reports():
    for name, rows in (("one", ONE), ("two", TWO)):
        for number, (place, value) in enumerate(rows):
            event = {"event": "measurement", "id": f"{name}-{number}", "robot": name, "position": degrees(place)}
            time, travelled = EPOCH + 100.0 * (number + 1), 250.0 * (number + 1)
            yield event | {"value": value, "time": time, "travelled": travelled}


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    """A live survey that goes on while the tests read its journal."""
    folder = tmp_path_factory.mktemp("live")
    (folder / "mission.yaml").write_text(MISSION, encoding="utf-8")
    (folder / "old.csv").write_text("x,y,salt\n390900,5820900,14.5\n", encoding="utf-8")
    prepared = prepare(load_survey(folder / "mission.yaml"))
    with LiveSurvey.from_prepared(prepared, journal=folder / "journal", epoch=EPOCH) as live:
        for event in reports():
            live.handle(event)
        live.handle({**next(reports()), "id": "one-0-again"})  # the same measurement: it counts once
        live.handle({"event": "withdraw", "id": "w", "robot": "one", "measurement": "one-2", "time": EPOCH + 900})
        yield live, folder


@pytest.fixture(scope="module")
def result(survey, tmp_path_factory):
    """The folder that `maipp result` wrote, and what it printed."""
    _, folder = survey
    out, before = tmp_path_factory.mktemp("out") / "new", (folder / "journal").read_bytes()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("maipp.devices._configured", True)
        assert (
            main(["result", str(folder / "journal"), "--out", str(out), "--cells", "20", "--foresight", "fitted"]) == 0
        )
    assert (folder / "journal").read_bytes() == before
    return out


@pytest.fixture(scope="module")
def told(result):
    return json.loads((result / "result.json").read_text(encoding="utf-8"))


@pytest.mark.skipif(find_spec("plotly") is None, reason="without plotly there is no report")
def test_the_report_has_the_foresight_s_map(result):
    page = (result / "report.html").read_text(encoding="utf-8")
    assert "Map error, fitted" in page and '"foreseen":{"name":"fitted"' in page


def bands(folder):
    with rasterio.open(folder / "map.tif") as file:
        return file.read(), file.transform, file.crs, file.descriptions, file.units


def test_the_map_is_the_live_survey_s_belief_in_the_mission_s_system(survey, result):
    live, _ = survey
    values, transform, crs, names, units = bands(result)
    foreseen = ("foreseen_mean", "foreseen_std")
    assert crs.to_epsg() == 25833 and names == ("mean", "std", "high_interest", *foreseen)
    assert units == ("g/L", "g/L", None, "g/L", "g/L")
    assert (transform.a, -transform.e) == pytest.approx((50.0, 50.0), rel=1e-3)  # 1 km in 20 cells
    rows, columns = np.nonzero(np.isfinite(values[0]))
    some = slice(None, None, len(rows) // 60)
    x, y = transform.c + transform.a * (columns + 0.5), transform.f + transform.e * (rows + 0.5)
    places = zip(x[some] - 390000, y[some] - 5820000, strict=True)
    answer = live.belief([tuple(degrees(place)) for place in places], "fitted")
    # The same belief in float32, at positions that went through degrees with nine digits.
    assert values[0][rows, columns][some] == pytest.approx(answer["mean"], abs=1e-3)
    assert values[1][rows, columns][some] == pytest.approx(answer["std"], abs=1e-3)
    for band, name in enumerate(foreseen, start=3):
        assert values[band][rows, columns][some] == pytest.approx(answer[name], abs=1e-3)
    # 2 where the mean reaches the threshold; 0 only where the bound does not, which is above the mean.
    assert ((values[2] == 2) == (values[0] >= 12)).all() and set(np.unique(values[2][rows, columns])) == {0, 1, 2}


def test_zones_islands_and_the_land_are_left_out(result):
    values, transform, *_ = bands(result)

    def known(x, y):
        column, row = (390000 + x - transform.c) / transform.a, (5820000 + y - transform.f) / transform.e
        cells = values[:, int(row), int(column)]
        assert np.isfinite(cells).all() or np.isnan(cells).all()
        return bool(np.isfinite(cells[0]))

    assert known(120, 270) and known(520, 630) and known(980, 980)
    assert not known(230, 270) and not known(650, 650)  # the zone, the island


def test_samples_are_as_reported_and_those_that_do_not_count_are_marked(result):
    with open(result / "samples.csv", encoding="utf-8", newline="") as file:
        rows = {row["id"]: row for row in csv.DictReader(file)}
    assert {name: (row["counts"], row["why_not"]) for name, row in rows.items() if row["counts"] == "no"} == {
        "one-2": ("no", "withdrawn"),
        "one-3": ("no", "surprise"),
        "two-1": ("no", "empty"),
    }
    assert set(rows) == {event["id"] for event in reports()}
    for event in reports():
        row = rows[event["id"]]
        place = [float(row["longitude"]), float(row["latitude"])]
        assert place == pytest.approx(event["position"], abs=1e-9) and float(row["value (g/L)"]) == event["value"]
        assert (row["robot"], float(row["time_s"])) == (event["robot"], event["time"])
    assert abs(float(rows["one-3"]["surprise"])) > 50 and abs(float(rows["one-0"]["surprise"])) < 2
    assert rows["one-2"]["surprise"]  # as it was answered, before it was withdrawn


def test_the_numbers_say_what_is_known_and_what_is_not(told):
    assert (told["title"], told["of"], told["date"]) == ("bay", "live survey", "2026-05-28")
    samples = told["samples"]
    assert (samples["taken"], samples["counted"], samples["before_the_survey"]) == (7, 4, 1)
    assert {each["id"] for each in samples["kept_out"]} == {"one-2", "one-3", "two-1"}
    left, error = told["uncertainty_left"], told["map_error"]
    assert 0 < left["trace"] < left["trace_before"] and 0 < left["std"] < left["std_before"] < 4.0
    assert error == {"known": False, "rmse": None, "expected": left["std"]}
    assert told["high_interest"]["threshold"] == pytest.approx(12) and told["high_interest"]["side"] == "above"
    one, two = told["robots"]
    assert (one["came_home"], two["came_home"]) == (True, False) and one["from_home"] < 15 and two["from_home"] > 800
    assert (one["budget"], one["travelled"], one["samples"]) == (pytest.approx(1500), pytest.approx(1250), 5)
    assert one["reserve"] == pytest.approx(100) and two["time"] == pytest.approx(200)


@pytest.mark.skipif(find_spec("plotly") is None, reason="the report needs plotly")
def test_the_report_says_it_in_words(result, told):
    page = (result / "report.html").read_text(encoding="utf-8")
    assert told["files"] == ["map.tif", "samples.csv", "report.html", "result.json"]
    assert {path.name for path in result.iterdir()} == set(told["files"])
    for words in ("Map error", "not known", "Came home", "Samples that do not count", "withdrawn by a person", "one-3"):
        assert words in page, words
    assert page.count("the sum, over the points of a grid") == 1


def test_an_earlier_journal_needs_its_mission(survey, result, tmp_path, capsys):
    _, folder = survey
    header, *records = read_journal(folder / "journal").records
    old = Journal(tmp_path / "old")
    for record in ({key: value for key, value in header.items() if key != "place"}, *records):
        old.append({key: value for key, value in record.items() if key != "seq"})
    old.close()
    (tmp_path / "old").write_bytes((tmp_path / "old").read_bytes() + b'{"sum":"12')  # being written
    arguments = ["result", str(tmp_path / "old"), "--out", str(tmp_path / "out"), "--cells", "20"]
    arguments += ["--foresight", "fitted"]
    assert main(arguments) == 2
    assert "an earlier version, without its mission; give that: --mission FILE" in capsys.readouterr().err
    assert main([*arguments, "--mission", str(folder / "mission.yaml")]) == 0
    assert "warning: the last 10 bytes of the journal are no whole line" in capsys.readouterr().out
    for mine, other in zip(bands(tmp_path / "out"), bands(result), strict=True):
        assert np.array_equal(mine, other, equal_nan=True) if isinstance(mine, np.ndarray) else mine == other


def recorded(expected=False):
    """A survey made by hand, of a file in metres."""
    x, y = np.linspace(0, 1.0, 9), np.linspace(0, 0.5, 9)
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    agents = [by_hand.agent((0.8, 0.2)), by_hand.agent((0.1, 0.48))]
    counts = np.array([len(agent.measurement_y) for agent in agents])
    agents = tuple(dataclasses.replace(agent, known=counts) for agent in agents)
    there = GeoReference((0.0, 0.0), (2000.0, 1000.0), (1.0, 0.5), 5.0, 15.0, value_name="salt (g/L)")
    told = agents, by_hand.bump(grid), np.ones(81, bool), 0, there
    return Episode(by_hand.SCENARIO, "by-hand", {}, 0, 0, *told, expected=expected)


def test_a_record_gives_the_same_files(tmp_path, capsys):
    episode = recorded()
    write_episode(episode, tmp_path / "episode.json")
    out = tmp_path / "out"
    assert main(["result", str(tmp_path), "--out", str(out), "--cells", "10"]) == 0
    told = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert told["map_error"]["rmse"] == pytest.approx(10 * episode.metrics.rmse) and told["of"] == "record"
    assert f"Map error: {told['map_error']['rmse']:.2f} g/L (RMSE" in capsys.readouterr().out
    values, transform, crs, *_ = bands(out)
    assert crs is None and values.shape == (3, 5, 10) and (transform.c, transform.f) == (0.0, 1000.0)
    # Cell (x, y) = (4, 3) from the lower left holds the file's (900, 700): 0.45, 0.35 of the domain.
    assert abs(values[0, 1, 4] - 5 - 10 * by_hand.bump(np.array([[0.45, 0.35]]))[0]) < 3 * values[1, 1, 4]
    with open(out / "samples.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(agent.measurement_y) for agent in episode.agents)
    assert {row["counts"] for row in rows} == {"yes"}


def test_what_was_only_expected_has_no_error(tmp_path):
    write_episode(recorded(expected=True), tmp_path / "episode.json")
    assert main(["result", str(tmp_path / "episode.json"), "--out", str(tmp_path / "out"), "--cells", "10"]) == 0
    told = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert told["map_error"]["rmse"] is None and "Planned, not measured" in told["notes"][0]
    assert dataclasses.replace(recorded(), expected=True).expected


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["nowhere"], "nowhere: cannot be read: No such file"),
        ([""], "a folder without an episode.json; give the journal of a `maipp live`"),
        (["mission.yaml"], "mission.yaml: neither a journal nor a record of a survey"),
        (["empty"], "empty: is empty"),
        (["other.json"], "other.json: schema: missing"),
        (["protocol"], "protocol: a journal of the protocol 'maipp.live/9'; this version reads maipp.live/1"),
        (["damaged"], "damaged: line 3 is damaged, or lines before it are missing"),
        (["torn"], "torn: holds not one whole line of a journal"),
        (["journal", "--cells", "9"], "--cells: 9 is not a number of cells from 10 to 2000"),
        (["journal", "--mission", "mission.yaml"], "journal: the journal holds its own mission; leave out --mission"),
        (["journal", "--out", "mission.yaml"], "mission.yaml: is a file; give a folder"),
        (["journal", "--out", "."], "is where journal is; give another folder"),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(survey, arguments, problem, tmp_path, capsys):
    _, folder = survey
    for name in ("journal", "mission.yaml", "old.csv"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    lines = (folder / "journal").read_bytes().splitlines(keepends=True)
    (tmp_path / "damaged").write_bytes(b"".join(lines[:2]) + lines[2].replace(b"measurement", b"measuremint", 1))
    (tmp_path / "torn").write_bytes(lines[0][:-1])
    (tmp_path / "empty").write_bytes(b"")
    (tmp_path / "other.json").write_text("{}", encoding="utf-8")
    journal = Journal(tmp_path / "protocol")
    journal.append({"journal": "maipp.live/9"})
    journal.close()
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    out = [] if "--out" in arguments else ["--out", str(tmp_path / "out")]
    paths = [each if each.startswith("--") or each.isdigit() else str(tmp_path / each) for each in arguments]
    assert main(["result", *paths, *out]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ") and problem in error and error.count("\n") == 1
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
