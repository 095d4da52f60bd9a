"""`TeamSurvey`: a live survey that several processes take part in, each of which keeps a log of its own events."""

from collections.abc import Callable, Mapping
from typing import Any

from maipp.errors import InputError
from maipp.live.belief_maps import BeliefMaps, belief_maps
from maipp.live.effects import inside, taken_late
from maipp.live.events import Change, Event, Heard, fingerprint, read_event
from maipp.live.journal_entries import read_change
from maipp.live.live_survey import LiveSurvey
from maipp.live.refits import Fits, take_up
from maipp.live.robot_state import RobotState
from maipp.records import Value


class TeamSurvey(LiveSurvey):
    """A live survey of which this process reports a part, and takes over what other processes have answered.

    Records may come in any order: what counts of them all is the same, to the bit.
    """

    def keep_in(self, append: Callable[[dict[str, Any]], object]) -> None:
        """From now on put the record of what is reported here into a log, on the disk, before it is answered."""
        self._keep = append

    def robot(self, name: str) -> RobotState:
        """What is known of a robot; not to be changed."""
        return self._robots[self._names.index(name)]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the robots of the team."""
        return tuple(self._names)

    def maps(self) -> BeliefMaps:
        """The belief on the evaluation grid, with the area of high interest."""
        self._check_sound()
        return belief_maps(self.world, self.setup, self._measurements)

    def take(self, record: Mapping[str, Any], writer: str) -> Event | None:
        """The event of a record of the robot `writer`, once it is taken over; None where that was known already.

        A robot writes of itself, and of what concerns the survey as a whole. Raises `InputError` for a record that is
        not right, and for the id of another event; then nothing has changed.
        """
        self._check_sound()
        values = Value(record)
        event = read_event(values["event"].mapping(), self._names)
        if not isinstance(event, Change) and event.robot != writer:
            raise InputError(f"an event of {event.robot} in the log of {writer}")
        digest = fingerprint(event)
        if event.id in self._answers:
            if self._answers[event.id][0] != digest:
                raise InputError(f"id: another event has the id {event.id[:60]!r}")
            return None
        answer, state = values["answer"].mapping(), read_change(event, values, packed=True)
        inner = inside(event, self.setup.units, self._nothing, self.setup.gate > 0)
        if not isinstance(event, Change):
            state = taken_late(event, inner, state, self._robot(event))
        effect = self._effect(event, inner, answer, state)
        if "kernels" in values:
            take_up(self._measurements.fits, values["kernels"].fit(Fits))
        self._apply(event, digest, answer, effect)
        return event

    def overhear(self, event: Heard) -> None:
        """Count on what a robot announces, until its log says the same or more. Raises `InputError` as `take`."""
        inner = inside(event, self.setup.units, self._nothing)
        changed = self._effect(event, inner, {}, None)
        self._robots[self._names.index(event.robot)] = changed.robot  # pyright: ignore[reportAttributeAccessIssue]
