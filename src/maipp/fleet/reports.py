"""What robots have reported, as a page takes it in: rows that are only ever added, and events in plain words."""

from typing import Any

from maipp.fleet.chart import Chart
from maipp.fleet.event_text import OUT, in_words
from maipp.live.events import Arrived, Event, Joined, Measurement
from maipp.live.team import TeamSurvey

# Events that are shown, the latest.
SHOWN = 200

# Number of the robot, seconds since the epoch, place, value (None: it only was there).
Row = tuple[int, float, float, float, float | None]


class Reports:
    """Rows and events of a survey, in the order in which they were taken over."""

    def __init__(self, survey: TeamSurvey, chart: Chart) -> None:
        self._survey, self._chart = survey, chart
        self.rows: list[Row] = []
        self.latest: dict[
            str, tuple[float, list[float], float | None]
        ] = {}  # time, place, way travelled, of each robot
        self.measured: dict[str, int] = {}  # measurements of each robot
        self._numbers: dict[str, int] = {}  # rows by the ids of measurements
        self._alike: dict[Row, int] = {}
        self._events: list[dict[str, Any]] = []

    def take(self, event: Event) -> None:
        """Take over an event that the survey has taken over."""
        epoch = self._survey.setup.units.epoch
        time = round(event.time - epoch, 3)
        if isinstance(event, Measurement | Arrived | Joined):
            self._add(event, time)
        robot = getattr(event, "robot", None)
        # The same event again gets the answer that was given.
        words = (
            None
            if isinstance(event, Measurement)
            else in_words(event, self._survey.report(event), self._survey.setup.units)
        )
        if words is not None:
            self._events.append({"time": time, "robot": robot, "kind": words[0], "text": words[1]})
            if len(self._events) > 2 * SHOWN:
                self._events = self._last(self._events)

    def tell(self, time: float, text: str) -> None:
        """Take over what the network tells; seconds since the epoch."""
        self._events.append({"time": round(time, 3), "robot": None, "kind": "network", "text": text})

    def events(self, kept_out: dict[int, str]) -> list[dict[str, Any]]:
        """The latest, in the order of time, with the measurements that do not count (rows, and why not)."""
        names, unit = self._survey.names, self._survey.setup.units.names["value"] or ""
        out = [
            {
                "time": self.rows[row][1],
                "robot": names[self.rows[row][0]],
                "kind": "gated",
                "text": f"value {self.rows[row][4]:g} {unit}".rstrip() + f" is not used: {OUT.get(why, why)}",
            }
            for row, why in kept_out.items()
        ]
        return self._last([*self._events, *out])

    def numbers(self, kept_out: list[dict[str, str]]) -> dict[int, str]:
        """Rows of the measurements that do not count, and why not; `kept_out` is that of a query for the state."""
        rows = ((self._numbers.get(each["id"]), each["reason"]) for each in kept_out)
        return {row: reason for row, reason in rows if row is not None}

    def _add(self, event: Measurement | Arrived | Joined, time: float) -> None:
        place = self._chart.place(event.position)
        if place is None:
            return
        value = event.value if isinstance(event, Measurement) else None
        row: Row = (self._survey.names.index(event.robot), time, place[0], place[1], value)
        if row not in self._alike:  # a measurement that is reported under two ids counts once
            self._alike[row] = len(self.rows)
            self.rows.append(row)
            if value is not None:
                self.measured[event.robot] = self.measured.get(event.robot, 0) + 1
        if value is not None:
            self._numbers[event.id] = self._alike[row]
        if time >= self.latest.get(event.robot, (-1.0,))[0]:
            travelled = 0.0 if isinstance(event, Joined) else event.travelled
            self.latest[event.robot] = time, place, travelled

    def _last(self, events: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return sorted(events, key=lambda event: event["time"])[-SHOWN:]
