"""What a robot is told: where to go, where to measure, how far it has come, and what it announces."""

from typing import Any

from maipp.live.arrival import ArrivalOutcome
from maipp.live.messages import describe, pack
from maipp.live.robot_state import RobotState
from maipp.live.units import Units


def decision_answer(
    made: ArrivalOutcome, head: dict[str, Any], robot: RobotState, odometer: float, units: Units
) -> dict[str, Any]:
    """The answer that says what was decided; `head` names event and robot."""
    if made.reason is not None:
        answer = {"answer": "stop"} | head | {"reason": made.reason}
    else:
        way = {"waypoints": units.points_out(made.leg[1:]), "measure": units.points_out(made.measure)}
        answer = {"answer": "home" if made.homeward else "go"} | head | way
        answer["arrival"] = units.time_out(made.arrival)
    message = None if made.reason is not None else describe(made.message, units)
    return answer | _way(robot, odometer, units) | {"message": message}


def state_of(made: ArrivalOutcome, odometer: float) -> dict[str, Any]:
    """What the journal keeps of a decision; `odometer` is the robot's where it was made, domain units."""
    return {
        "odometer": odometer,
        "planned": made.planned,
        "leg": made.leg.tolist(),
        "homeward": made.homeward,
        "message": pack(made.message),
        "memory": pack(made.memory),
    }


def late(robot: RobotState, head: dict[str, Any], units: Units) -> dict[str, Any]:
    """The answer to a report that is older than the robot's latest: what it was told there stands."""
    if robot.answer is None:
        stop = {"answer": "stop"} | head | {"reason": "gone"} | _way(robot, robot.odometer, units)
        return stop | {"message": None, "late": True}
    again = {key: value for key, value in robot.answer.items() if key not in ("answer", "id", "robot")}
    return {"answer": robot.answer["answer"]} | head | again | {"late": True}


def _way(robot: RobotState, odometer: float, units: Units) -> dict[str, Any]:
    left = max(robot.budget - odometer, 0.0)
    return {"travelled": units.length_out(odometer), "remaining": units.length_out(left)}
