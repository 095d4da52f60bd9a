"""What one robot believes: a survey made up of the beginnings of all logs, as far as that robot has them."""

import json
from collections.abc import Mapping
from typing import Any

from maipp.errors import InputError
from maipp.fleet.log import Head, Origin
from maipp.fleet.logs import Logs
from maipp.live.events import Change
from maipp.live.team import TeamSurvey
from maipp.live.world import Setup, World


class Replica:
    """Follows one robot. Its survey is as that robot's where it has told how far it is."""

    def __init__(self, world: World, setup: Setup) -> None:
        """Of the survey that nothing was changed of yet."""
        self._world, self._setup = world, setup
        self._begin()

    def _begin(self) -> None:
        self.survey = TeamSurvey(self._world, self._setup)
        self._taken: dict[Origin, int] = {}
        self._waiting: list[tuple[Origin, dict[str, Any]]] = []  # records that name what is not known yet

    def follow(self, logs: Logs, heads: Mapping[Origin, Head]) -> TeamSurvey:
        """The survey as far as these heads go and the logs hold them."""
        ends = {o: min(head.length, logs.length(o)) for o, head in heads.items() if logs.agrees(o, head)}
        if any(ends.get(origin, 0) < taken for origin, taken in self._taken.items()):
            self._begin()  # the robot has lost some of what it carried for others
        for origin, end in sorted(ends.items()):
            begin = self._taken.get(origin, 1)  # a log's first line is its header
            with logs.lock:
                lines = logs.known[origin].lines[begin:end] if origin in logs.known else []
            for line in lines:
                self._take(origin, json.loads(line))
            self._taken[origin] = max(begin, end)
        return self.survey

    def _take(self, origin: Origin, record: dict[str, Any]) -> None:
        try:
            event = self.survey.take(record, origin.robot)
        except InputError as error:
            if "robot" in str(error):  # one that has joined, as the rest of the logs will say
                self._waiting.append((origin, record))
            return
        if isinstance(event, Change):
            waiting, self._waiting = self._waiting, []
            for each in waiting:
                self._take(*each)
