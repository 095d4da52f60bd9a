"""The report in a real browser, without a network: it draws, the slider moves everything, the console stays clean."""

import dataclasses
import io

import numpy as np
import pytest
from PIL import Image

from maipp.engine.episode import Episode
from maipp.scenario import Scenario
from maipp.team.broadcast import Broadcast
from maipp.viz.report import Foreseen, SurveyReport, write_report
from tests.shared.chromium import CHROMIUM, FLAGS, MARKS

pytest.importorskip("plotly")
sync_api = pytest.importorskip("playwright.sync_api")

pytestmark = MARKS
PATIENCE = 120_000  # milliseconds; only a page that never gets there waits so long
NASTY = '</script ></script><b>"Ünï %{x}</b>'


class Visit:
    """A page opened from disk in a browser that is offline, with all that it asked for and said."""

    def __init__(self, browser, path, **window):
        self.requests, self.said = [], []
        context = browser.new_context(offline=True, **({"viewport": {"width": 1300, "height": 900}} | window))
        self.page = context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("console", lambda message: self.said.append(f"{message.type}: {message.text}"))
        self.page.on("pageerror", lambda error: self.said.append(f"error: {error}"))
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("body[data-ready]", state="attached")

    def clean(self):
        """Nothing said on the console, and nothing asked for but what is on this machine."""
        assert self.said == []
        assert [url for url in self.requests if not url.startswith(("file:", "data:", "blob:"))] == []
        assert sum(url.startswith("file:") for url in self.requests) == 1

    def until(self, condition):
        """Wait for a condition, asked from outside: the page forbids what Playwright would wait with inside it."""
        for _ in range(PATIENCE // 50):
            if self.page.evaluate(condition):
                return
            self.page.wait_for_timeout(50)
        raise AssertionError(f"still not so: {condition}")

    def move_to(self, frame):
        self.page.evaluate(
            "k => { const s = document.getElementById('moment'); s.value = k; s.dispatchEvent(new Event('input')); }",
            frame,
        )
        self.page.wait_for_selector(f'body[data-frame="{frame}"]', state="attached")

    def traces(self, plot):
        return self.page.evaluate("id => document.getElementById(id).data", plot)

    def lines(self, plot):
        """The robots' trails on a map: coloured lines that are wider than others."""
        return [t for t in self.traces(plot) if t.get("line", {}).get("width") == 2.5 and t["type"] == "scatter"]

    def colours(self, plot):
        """How many different colours a plot has on the screen."""
        shot = self.page.locator(f"#{plot}").screenshot()
        pixels = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"))
        return len(np.unique(pixels.reshape(-1, 3), axis=0))


@pytest.fixture(scope="module")
def browser():
    with sync_api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield found
        found.close()


@pytest.fixture(scope="module")
def full(episode, mapping):
    """Every optional fact: names, rings, earlier samples, intents, announced places, warnings."""
    nothing = np.full(2, np.nan), np.full(3, np.nan)
    places = np.array([[0.4, 0.15], [0.6, 0.2]])
    told = (
        Broadcast(0, 0.0, np.array([0.5, 0.2]), np.array([0.01, 0.0, 0.004]), np.empty((0, 2)), np.empty(0)),
        Broadcast(1, 0.0, *nothing, places, np.array([0.1, 0.3])),
        Broadcast(0, float(episode.end), *nothing, np.empty((0, 2)), np.empty(0)),
    )
    return SurveyReport(
        dataclasses.replace(
            episode, reference=dataclasses.replace(mapping, value_name="temperature (°C)", metres_per_unit=5000.0)
        ),
        title=NASTY,
        names=("Ada", NASTY),
        seconds_per_time=1800.0,
        area=np.array([[10.05, 60.02], [11.9, 60.02], [11.9, 60.48], [10.9, 60.4], [10.05, 60.48]]),
        no_go=(np.array([[11.4, 60.3], [11.7, 60.3], [11.5, 60.4]]),),
        prior_x=np.array([[10.5, 60.2], [11.0, 60.1]]),
        prior_y=np.array([25.0, 15.0]),
        broadcasts=told,
        warnings=(NASTY,),
        foreseen=Foreseen("fitted", episode.truth, np.linspace(0.0, 0.2, 81)),
    )


@pytest.fixture(scope="module")
def visit(browser, full, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, full)
    return Visit(browser, path)


def test_everything_is_drawn(visit):
    for plot in (
        "map-mean",
        "map-std",
        "map-area",
        "map-truth",
        "map-foreseen",
        "map-foreseen-std",
        "curve-trace",
        "curve-rmse",
    ):
        assert visit.page.locator(f"#{plot} svg.main-svg").count() >= 1
    assert visit.colours("map-mean") > 300 and visit.colours("map-truth") > 300 and visit.colours("map-std") > 100
    assert visit.colours("map-foreseen") > 300 and visit.colours("map-foreseen-std") > 100
    assert visit.colours("map-area") > 20 and visit.colours("curve-trace") > 10
    # A heat map is an image; the rest are paths.
    assert visit.page.locator("#map-mean .heatmaplayer image").count() == 1
    assert visit.page.locator("#map-area .contourlayer path").count() >= 1
    visit.clean()


def test_names_are_text_and_nothing_else(visit):
    visit.move_to(2)
    assert visit.page.title() == NASTY
    assert visit.page.locator("h1").inner_text() == NASTY
    assert NASTY in visit.page.locator("#legend").inner_text()
    on_map = visit.page.locator("#map-mean .scatterlayer").first.text_content()
    assert NASTY[:15] in on_map
    assert visit.page.locator("h1 b, #legend label b, tbody b").count() == 0
    visit.clean()


def test_the_slider_moves_time_routes_measurements_and_maps(visit):
    seen = []
    last = int(visit.page.get_attribute("#moment", "max"))
    for frame in (0, last // 2, last):
        visit.move_to(frame)
        robots = [t for t in visit.traces("map-std") if t.get("mode") == "markers+text"][0]
        spots = [t for t in visit.traces("map-area") if t.get("marker", {}).get("size") == 6.5][0]
        seen.append(
            {
                "label": visit.page.locator("#now").inner_text(),
                "spoken": visit.page.get_attribute("#moment", "aria-valuetext"),
                "mean": visit.traces("map-mean")[0]["z"],
                "std": visit.traces("map-std")[0]["z"],
                "area": visit.traces("map-area")[0]["z"],
                "route": [line["x"] for line in visit.lines("map-truth")],
                "robots": robots["x"],
                "spots": spots["x"],
                "moment": visit.traces("curve-trace")[1]["x"],
                "error": visit.traces("curve-rmse")[1]["y"],
                "pixels": visit.page.locator("#map-mean").screenshot(),
            }
        )
    for key in seen[0]:
        assert seen[0][key] != seen[1][key] != seen[2][key], key
    assert "min" in seen[0]["label"] and seen[0]["label"].startswith("0")
    assert seen[0]["spots"] == []
    visit.clean()


def test_the_last_frame_is_the_whole_record(visit, full):
    visit.move_to(int(visit.page.get_attribute("#moment", "max")))
    episode = full.episode
    for line, agent in zip(visit.lines("map-mean"), episode.agents, strict=True):
        route = episode.geo.to_user(agent.route)
        np.testing.assert_allclose([line["x"][0], line["y"][0]], route[0], atol=1e-4)
        np.testing.assert_allclose([line["x"][-1], line["y"][-1]], route[-1], atol=1e-4)
    expected = episode.geo.to_user_values(episode.beliefs(np.array([episode.end + 1])).mean[0]).reshape(9, 9).T
    np.testing.assert_allclose(np.array(visit.traces("map-mean")[0]["z"], float), expected, atol=0.01)
    spots = [t for t in visit.traces("map-mean") if t.get("marker", {}).get("size") == 6.5][0]
    assert len(spots["x"]) == sum(len(agent.measurement_y) for agent in episode.agents)


def test_intents_and_announced_places_come_and_go(visit):
    def dotted():
        shown = [t for t in visit.traces("map-area") if t.get("line", {}).get("dash") == "dot" and len(t["x"])]
        return sorted(len(t["x"]) for t in shown)

    visit.move_to(0)
    assert dotted() == [3, 33]  # the robot and two places; an ellipse
    visit.page.click('[data-layer="told"]')
    visit.until("document.getElementById('map-area').data.every(t => !t.line || t.line.dash !== 'dot' || !t.x.length)")
    visit.page.click('[data-layer="told"]')
    visit.move_to(int(visit.page.get_attribute("#moment", "max")))
    assert dotted() == []
    visit.clean()


def test_a_robot_can_be_hidden(visit):
    visit.page.click('[data-robot="1"]')
    visit.until("document.getElementById('map-mean').data.filter(t => t.mode === 'markers+text')[0].x.length === 1")
    assert [len(line["x"]) > 0 for line in visit.lines("map-mean")] == [True, False]
    visit.page.click('[data-robot="1"]')


def test_zooming_one_map_zooms_all(visit):
    visit.page.evaluate("Plotly.relayout('map-mean', {'xaxis.range': [10.2, 10.6], 'yaxis.range': [60.1, 60.2]})")
    visit.until("document.getElementById('map-std').layout.xaxis.range[1] < 11")
    middle = visit.page.evaluate("document.getElementById('map-truth')._fullLayout.xaxis.range.reduce((a, b) => a + b)")
    assert middle == pytest.approx(20.8, abs=0.01)
    visit.clean()


def test_play_goes_on_by_itself_and_stops_at_the_end(visit):
    last = int(visit.page.get_attribute("#moment", "max"))
    visit.move_to(last)
    visit.page.click("#play")  # at the end: from the start again
    visit.until("Number(document.getElementById('moment').value) < 10")
    assert visit.page.get_attribute("#play", "aria-label") == "Pause"
    visit.until("Number(document.body.dataset.frame) >= 3")
    visit.page.click("#play")
    assert visit.page.get_attribute("#play", "aria-label") == "Play"
    visit.move_to(last - 2)
    visit.page.click("#play")
    visit.page.wait_for_selector(f'body[data-frame="{last}"]', state="attached")
    visit.page.wait_for_selector('#play[aria-label="Play"]')
    visit.page.click("#back")
    visit.page.wait_for_selector(f'body[data-frame="{last - 1}"]', state="attached")
    visit.page.focus("#moment")
    visit.page.keyboard.press("ArrowRight")
    visit.page.wait_for_selector(f'body[data-frame="{last}"]', state="attached")
    visit.clean()


def test_a_phone_shows_all_of_it_in_one_column(browser, full, tmp_path):
    write_report(tmp_path / "report.html", full)
    window = {"viewport": {"width": 375, "height": 700}, "has_touch": True, "is_mobile": True}
    phone = Visit(browser, tmp_path / "report.html", **window)
    assert phone.page.evaluate("document.documentElement.scrollWidth") <= 375
    lefts = phone.page.evaluate(
        "[...document.querySelectorAll('#maps figure')].map(f => f.getBoundingClientRect().left)"
    )
    assert len(lefts) == 6 and len(set(lefts)) == 1
    phone.clean()


def unlike(episode: Episode, *, agents: int, extent: tuple[float, float]) -> Episode:
    """A survey of another size in which nothing was measured, and nobody moved if it is a team of one."""
    scenario = Scenario.create(agents=agents, budget=0.8, grid=9, extent=extent, start=[0.1, 0.1])
    moves = agents > 1
    records = tuple(
        dataclasses.replace(
            episode.agents[0],
            route=np.array([[0.1, 0.1], [0.02 + 0.02 * i, 0.2]], np.float32)[: 1 + moves],
            route_time=np.array([0.0, 0.3], np.float32)[: 1 + moves],
            distance=0.3 * moves,
            measurement_x=np.empty((0, 2), np.float32),
            measurement_y=np.empty(0, np.float32),
            measurement_time=np.empty(0, np.float32),
            known=np.zeros(agents, int),
        )
        for i in range(agents)
    )
    return dataclasses.replace(episode, scenario=scenario, agents=records, inside=np.ones(81, bool))


@pytest.mark.parametrize(("agents", "extent"), [(10, (0.25, 1.0)), (1, (1.0, 0.25))])
def test_large_teams_narrow_areas_and_empty_surveys_are_drawn(browser, episode, tmp_path, agents, extent):
    survey = unlike(episode, agents=agents, extent=extent)
    write_report(tmp_path / "report.html", SurveyReport(survey, truth_known=agents > 1))
    visit = Visit(browser, tmp_path / "report.html")
    assert len(visit.lines("map-mean")) == agents
    assert visit.page.locator("tbody tr").count() == agents
    assert visit.page.locator("#map-truth").count() == (agents > 1)
    assert visit.page.is_disabled("#play") == (agents == 1)
    box = visit.page.locator("#map-mean").bounding_box()
    assert box is not None and box["width"] <= 1300 and 100 < box["height"] <= 900
    visit.clean()
