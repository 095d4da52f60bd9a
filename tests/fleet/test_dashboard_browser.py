"""The dashboard in a real browser: it draws, follows, survives a restart, fits a phone; the console stays clean."""

import copy
from urllib.parse import urlsplit

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from maipp.fleet.dashboard import Board, Follower, save_page, serve
from maipp.fleet.dashboard.look import look
from maipp.fleet.logs import Logs
from maipp.fleet.watch import Watch
from maipp.live.gate import LEVEL
from maipp.live.team import TeamSurvey
from maipp.scenario import Scenario
from maipp.viz.style import agent_colour
from tests.conftest import TINY_PLANNERS
from tests.fleet.pages import PACE, Pretended, Shown, Visit
from tests.shared.chromium import CHROMIUM, FLAGS, MARKS

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
sync_api = pytest.importorskip("playwright.sync_api")

pytestmark = MARKS
NASTY = "<b>\"Ünï</b><script>document.title='gone'</script>"
SCENARIO = Scenario(agents=3, budget=1.2, start=(0.5, 0.5), end="start", grid=8, nodes=16, neighbours=5)


# Of the three robots, red, green and blue.
COLOURS = [tuple(round(255 * part) for part in to_rgb(agent_colour(robot))) for robot in range(3)]


@pytest.fixture(scope="module")
def shown(make_team):
    made = Shown(make_team(SCENARIO, ("ti", TINY_PLANNERS["ti"]), gate=LEVEL))
    yield made
    made.dashboard.close()


@pytest.fixture(scope="module")
def browser():
    with sync_api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield found
        found.close()


@pytest.fixture
def visit(browser, shown):
    made = Visit(browser, shown)
    yield made
    made.close()


def near(pixels, colour):
    """How many pixels are of about this colour."""
    return int((np.abs(pixels.astype(int) - colour).max(axis=1) < 12).sum())


def test_maps_robots_and_words_are_drawn(visit, shown):
    page = visit.page
    assert page.title() == f"{shown.team.setup.site.title} – fleet"
    for name, least in (("mean", 300), ("std", 100), ("area", 20)):
        assert len(np.unique(visit.pixels(name), axis=0)) > least
    # Okabe and Ito's vermillion, sky blue and purple: trails, plans and the robots themselves.
    for colour in ((213, 94, 0), (86, 180, 233), (204, 121, 167)):
        assert near(visit.pixels("mean"), colour) > 60
    assert page.locator(".card").count() == 3
    assert page.locator(".card h3").all_inner_texts() == [*shown.team.names]
    text = page.locator(".card").first.inner_text()
    assert "on its way" in text and "of 1.200 units travelled" in text and "home (striped)" in text
    assert page.locator(".budget").count() == 3
    assert page.locator("#radio td.yes").count() == 6
    decisions = sum(event["kind"] == "decision" for event in shown.watch.snapshot()["events"])
    assert page.locator("#events .decision").count() == decisions > 3
    assert page.locator("#link").inner_text() == "live"
    visit.clean()


def test_what_one_robot_believes(visit, shown):
    shown.team.hub.part([["robot1", "watch"], ["robot2", "robot3"]])
    shown.measure("robot1", (0.3, 0.3), 0.61)
    shown.team.hub.heal()
    shown.follower.show()
    visit.until(f"document.body.dataset.field === '{len(shown.watch.snapshot()['rows']) - count_arrivals(shown)}'")
    pooled, before = visit.page.evaluate("document.body.dataset.field"), visit.pixels("std")
    visit.page.click(".card:nth-child(2) button")
    visit.until("document.body.dataset.who === 'robot2'")
    assert int(visit.page.evaluate("document.body.dataset.field")) == int(pooled) - 1
    assert "what robot2 knew" in visit.page.locator("#known").inner_text()
    assert (visit.pixels("std") != before).any()
    visit.page.select_option("#who", "")
    visit.until("document.body.dataset.who === ''")
    assert visit.page.evaluate("document.body.dataset.field") == pooled
    visit.clean()


def count_arrivals(shown):
    return sum(row[4] is None for row in shown.watch.snapshot()["rows"])


def test_it_follows(visit, shown):
    rows, before = int(visit.page.evaluate("document.body.dataset.rows")), visit.pixels("mean")
    field = int(visit.page.evaluate("document.body.dataset.field"))
    shown.measure("robot1", (0.8, 0.2), 0.6)
    visit.until(f"document.body.dataset.rows === '{rows + 1}' && document.body.dataset.field === '{field + 1}'")
    visit.page.wait_for_timeout(50)  # until it has been painted
    assert (visit.pixels("mean") != before).any()
    # A value that is kept out: a cross on the map, and a line in words.
    red = near(visit.pixels("area"), (179, 0, 27))
    shown.measure("robot1", (0.8, 0.8), 77.0)
    visit.until("document.querySelectorAll('#events .gated').length === 1")
    assert "value 77 is not used" in visit.page.locator("#events .gated").inner_text()
    visit.page.wait_for_timeout(50)
    assert near(visit.pixels("area"), (179, 0, 27)) > red
    assert visit.page.evaluate("document.body.dataset.field") == str(field + 1)
    visit.clean()


def test_names_that_people_chose_are_text(browser, shown):
    snapshot = copy.deepcopy(shown.watch.snapshot()) | {"look": look()}
    snapshot["place"]["title"] = snapshot["robots"][0]["name"] = snapshot["place"]["quantity"] = NASTY
    snapshot["changes"]["zones"] = [{"name": NASTY, "ring": [[0.05, 0.05], [0.2, 0.05], [0.2, 0.2]]}]
    snapshot["events"].append({"time": 1.0, "robot": NASTY, "kind": "network", "text": NASTY})
    board = Board()
    board.publish(snapshot)
    board.publish_field(None, shown.watch.field())
    with serve(board) as dashboard:
        visit = Visit(browser, Pretended(dashboard))
        assert visit.page.title() == f"{NASTY} – fleet" and visit.page.locator("h1").inner_text() == NASTY
        assert NASTY in visit.page.locator("#events .network").inner_text()
        assert visit.page.locator(".card h3").first.inner_text() == NASTY
        assert NASTY in visit.page.locator("#radio").inner_text()
        assert NASTY in visit.page.locator("#who").inner_text()
        assert visit.page.locator("body script, h1 b, h3 b, td b, #events b b").count() == 0
        visit.clean()
        visit.close()


def test_it_survives_a_restart_of_the_server(visit, shown):
    rows = visit.page.evaluate("document.body.dataset.rows")
    shown.dashboard.close()
    visit.until("document.body.dataset.link === 'away'")
    assert "no connection" in visit.page.locator("#link").inner_text()
    assert int(visit.page.evaluate("document.body.dataset.rows")) == int(rows)  # what was known is still shown
    shown.start()
    visit.until("document.body.dataset.link === 'live'")
    shown.measure("robot1", (0.7, 0.3), 0.63)
    visit.until(f"document.body.dataset.rows === '{int(rows) + 1}'")
    visit.until(f"document.body.dataset.field === '{shown.watch.snapshot()['now']['measurements']}'")
    # While the server was away the browser itself says so, and nothing else.
    assert all("ERR_" in text and text.startswith("error: Failed to load resource") for text in visit.said)


def test_keys_and_buttons_zoom_and_move_all_maps(visit):
    before = {name: visit.pixels(name) for name in ("mean", "std")}
    visit.page.focus("#map-mean")
    visit.page.keyboard.press("+")
    visit.page.keyboard.press("ArrowLeft")
    visit.until("document.querySelector('#map-std').hasAttribute('data-zoomed')")
    assert all((visit.pixels(name) != before[name]).any() for name in before)
    assert " at " in visit.page.locator("#readout").inner_text()
    visit.page.click("#maps figure:nth-child(2) [aria-label='Show all']")
    visit.until("!document.querySelector('#map-std').hasAttribute('data-zoomed')")
    for _ in range(3):  # every control can be reached without a mouse
        visit.page.keyboard.press("Tab")
    assert visit.page.evaluate("document.activeElement !== document.body")
    visit.page.uncheck('[data-layer="trails"]')
    visit.page.wait_for_timeout(50)
    # Where a robot went follows its policy, by rounding: its trail may lie under what is drawn above it.
    left = [near(visit.pixels("mean"), colour) - near(before["mean"], colour) for colour in COLOURS]
    assert min(left) < 0 and max(left) <= 0
    visit.clean()


def test_a_saved_page_needs_no_server(browser, shown, tmp_path):
    save_page(shown.watch, tmp_path / "page.html")
    visit = Visit(browser, shown, (tmp_path / "page.html").as_uri())
    page, pooled = visit.page, str(shown.watch.snapshot()["now"]["measurements"])
    assert page.locator("#link").inner_text() == "saved: as it stood then"
    assert page.evaluate("document.body.dataset.field") == pooled and page.locator(".card").count() == 3
    assert len(np.unique(visit.pixels("mean"), axis=0)) > 300
    page.select_option("#who", "robot2")
    page.wait_for_function("document.body.dataset.who === 'robot2'")
    assert page.evaluate("document.body.dataset.field") == str(shown.watch.field("robot2")["measurements"])
    assert visit.said == [] and {urlsplit(url).scheme for url in visit.requests} <= {"file", "data"}
    visit.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_shows_one_map_at_a_time(browser, shown, scheme):
    window = {"viewport": {"width": 375, "height": 700}, "has_touch": True, "is_mobile": True}
    visit = Visit(browser, shown, color_scheme=scheme, **window)
    page = visit.page
    assert page.evaluate("document.documentElement.scrollWidth") <= 375
    visible = "[...document.querySelectorAll('#maps figure')].filter(f => !f.hidden).length"
    assert page.evaluate(visible) == 1
    page.tap("#choice [data-map=std]")
    visit.until("!document.querySelector('#map-std').closest('figure').hidden")
    assert page.evaluate(visible) == 1 and len(np.unique(visit.pixels("std"), axis=0)) > 100
    dark = page.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
    assert dark == (scheme == "dark")
    lefts = page.evaluate("[...document.querySelectorAll('.card')].map(c => c.getBoundingClientRect().left)")
    assert len(lefts) == 3 and len({*lefts}) == 1
    small = page.evaluate(
        "[...document.querySelectorAll('button')].filter(b => b.offsetParent && b.offsetHeight < 28).length"
    )
    assert small == 0  # pixels that a finger finds
    visit.clean()
    visit.close()


def test_a_team_that_nobody_has_heard_of_yet(browser, shown):
    """A page from before the first word of any robot."""
    team = shown.team
    survey, logs = TeamSurvey(team.world, team.setup), Logs(None, None, team.mission)
    team.hub.part([["lonely"]])
    watch = Watch(survey, logs, team.hub.link("lonely"), team.clock, pace=PACE)
    alone = Shown.__new__(Shown)
    alone.team, alone.watch, alone.board = team, watch, Board()
    alone.follower = Follower(watch, alone.board, period=0.05)
    alone.dashboard = serve(alone.board)
    visit = Visit(browser, alone)
    assert visit.page.locator(".card").count() == 3
    assert "not heard yet" in visit.page.locator(".card").first.inner_text()
    assert visit.page.locator("#events").inner_text() == "nothing yet"
    visit.clean()
    visit.close()
    alone.dashboard.close()
    team.hub.heal()
