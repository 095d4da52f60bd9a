"""Events and answers that the tests of live surveys share."""

import json


def text(answer):
    """An answer as JSON: equal only if every bit of every number is."""
    return json.dumps(answer, allow_nan=False)


def arrived(name, robot="robot1", position=(0.5, 0.5), time=0.0, **more):
    return {"event": "arrived", "id": name, "robot": robot, "position": list(position), "time": time} | more


def measured(name, position=(0.4, 0.6), time=0.1, value=1.0, robot="robot1"):
    found = {"position": list(position), "value": value, "time": time}
    return {"event": "measurement", "id": name, "robot": robot} | found
