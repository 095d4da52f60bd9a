"""A robot's process: its loop, at its own pace, until it is told to end."""

from threading import Event

from maipp.fleet.robot import Robot

TICK = 0.02  # s between two looks at the network and the vehicle


def run(robot: Robot, told_to_end: Event, tick: float = TICK) -> None:
    """Go on until the event is set. What is under way then is in the log."""
    robot.begin()
    while not told_to_end.wait(tick):
        robot.work()
