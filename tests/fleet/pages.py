"""A fleet with a dashboard, and a page of it in a browser."""

import io
from urllib.parse import urlsplit

import numpy as np
from PIL import Image

from maipp.fleet.dashboard import Board, Follower, serve
from maipp.fleet.logs import Logs
from maipp.fleet.member import Pace
from maipp.fleet.watch import Watch
from maipp.live.events import Measurement
from maipp.live.team import TeamSurvey

PATIENCE = 60_000  # milliseconds; only a page that never gets there waits so long
PACE = Pace(beat=0.02, round=0.1, contact=0.1, silent=0.5)


class Shown:
    """A fleet with a dashboard; what it does next it does when it is told to."""

    def __init__(self, team):
        self.team, self.port, self._wanted = team, 0, None
        field = lambda points: np.sin(7 * points[:, 0]) + points[:, 1]  # noqa: E731
        self.robots = [team.robot(i, team.vehicle(i, field), pace=PACE) for i in range(3)]
        self.fleet = team.fleet(self.robots, beat=PACE.beat)
        self.fleet.run(until=0.5)
        self.start()

    def start(self):
        """Begin to watch, as another process would, at the same port."""
        team = self.team
        survey, logs = TeamSurvey(team.world, team.setup), Logs(None, None, team.mission)
        self.watch = Watch(survey, logs, team.hub.link("watch"), team.clock, pace=PACE)
        self.board = Board()
        self.follower = Follower(self.watch, self.board, period=0.05)
        self.dashboard = serve(self.board, port=self.port)
        self.port = urlsplit(self.dashboard.url).port or 0
        self.tell()

    def tell(self):
        """Let the watcher hear all that the robots know, and show it."""
        for robot in self.robots:
            robot.member.exchange.beat()
        self.watch.member.listen()
        self.watch.member.meet()
        self.follower.show()

    def measure(self, name, place, value):
        robot = next(robot for robot in self.robots if robot.name == name)
        robot.survey.report(Measurement(f"more{value}", robot.name, place, value, self.team.clock.time))
        self.tell()


class Pretended:
    """A dashboard of which nothing changes."""

    def __init__(self, dashboard):
        self.dashboard = self.follower = dashboard
        dashboard.work = lambda: None


class Visit:
    """A page of the dashboard, with all that it asked for and said."""

    def __init__(self, browser, shown, url=None, **window):
        self.shown, self.requests, self.said = shown, [], []
        self.context = browser.new_context(**({"viewport": {"width": 1300, "height": 900}} | window))
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("console", lambda message: self.said.append(f"{message.type}: {message.text}"))
        self.page.on("pageerror", lambda error: self.said.append(f"error: {error}"))
        self.page.goto(url or shown.dashboard.url)
        self.until("document.body.dataset.field !== undefined && document.body.dataset.ready !== undefined")

    def until(self, condition):
        """Wait for a condition, while the watcher goes on."""
        for _ in range(PATIENCE // 20):
            self.shown.follower.work()
            if self.page.evaluate(condition):
                return
            self.page.wait_for_timeout(20)
        raise AssertionError(f"still not so: {condition}")

    def clean(self):
        """Nothing said on the console, and nothing asked for but of this server."""
        assert self.said == []
        assert {urlsplit(url).netloc for url in self.requests if not url.startswith("data:")} == {
            urlsplit(self.shown.dashboard.url).netloc
        }

    def pixels(self, name):
        """What a map shows, as rows of red, green and blue."""
        shot = self.page.locator(f"#map-{name}").screenshot()
        return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).reshape(-1, 3)

    def close(self):
        self.context.close()
