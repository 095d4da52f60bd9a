"""The numbers of a result, in the caller's coordinates and units: what result.json holds and the words are made of."""

import math
from typing import Any

import numpy as np

from maipp.results.field_map import FieldMap
from maipp.results.geotiff import bands
from maipp.results.taken import Taken, TakenRobot, TakenSample

SCHEMA = "maipp.result/1"


def numbers(taken: Taken, drawn: FieldMap) -> dict[str, Any]:
    """The result as plain numbers, texts and lists, ready for JSON; what is not known is None (docs/live.md)."""
    episode, frame = taken.episode, taken.frame
    counted = sum(sample.out is None for sample in taken.samples)
    geographic, (length, name) = frame.geographic, length_unit(taken)
    threshold = float(frame.to_user_values(episode.scenario.threshold)) if taken.threshold_given else None
    return {
        "schema": SCHEMA,
        "source": taken.source,
        "of": "live survey" if taken.live else "record",
        "title": taken.title,
        "date": taken.date,
        "planner": taken.planner,
        "units": {
            "position": "degrees (longitude, latitude)" if geographic else frame.x_name,
            "length": name,
            "value": frame.unit,
            "time": "s" if taken.seconds_per_time else "1 domain unit at speed 1",
        },
        "map": {
            "crs": taken.crs.name,
            "cells": list(drawn.mean.shape[::-1]),
            "cell": list(drawn.cell),
            "bands": list(bands(drawn)),
        },
        **_quality(taken),
        "high_interest": {
            "threshold": threshold,
            "side": None if threshold is None else "below" if frame.inverted else "above",
            "predicted": drawn.share(2),
            "not_ruled_out": drawn.share(1),
        },
        "samples": {
            "taken": len(taken.samples),
            "counted": counted,
            "before_the_survey": 0 if episode.prior is None else len(episode.prior.y),
            "kept_out": [_sample(sample) for sample in taken.kept_out],
        },
        "robots": [_robot(taken, robot, length) for robot in taken.robots],
        "notes": list(taken.notes),
    }


def length_unit(taken: Taken) -> tuple[float, str]:
    """How long a domain unit is, and in what."""
    frame = taken.frame
    if frame.metres_per_unit is not None:
        return frame.metres_per_unit, "m"
    if taken.episode.reference is not None and frame.length_scale is not None:
        return frame.length_scale, "map units"
    return 1.0, "domain units"


def _quality(taken: Taken) -> dict[str, Any]:
    """Uncertainty before and after, and the error of the map where it is known."""
    episode = taken.episode
    belief, inside, metrics = episode.beliefs(np.array([-1.0, np.inf])), episode.inside, episode.metrics
    variance = np.maximum(np.asarray(belief.variance, np.float64)[:, inside], 0.0)
    before, after = taken.frame.to_user_std(np.sqrt(variance.mean(axis=1))).tolist()
    start, end = (float(trace) for trace in belief.trace)
    return {
        "uncertainty_left": {
            "trace": end,
            "trace_before": start,
            "share": end / start if start > 0 else None,
            "std": after,
            "std_before": before,
        },
        "map_error": {
            "known": taken.truth_known,
            "rmse": _real(float(taken.frame.to_user_std(metrics.rmse))) if taken.truth_known else None,
            "expected": after,
        },
    }


def _sample(sample: TakenSample) -> dict[str, Any]:
    return {
        "id": sample.id,
        "robot": sample.robot,
        "time": sample.time,
        "position": [sample.x, sample.y],
        "value": sample.value,
        "surprise": sample.surprise,
        "why_not": sample.out,
    }


def _robot(taken: Taken, robot: TakenRobot, length: float) -> dict[str, Any]:
    x, y = taken.frame.to_user(robot.position).tolist()
    return {
        "name": robot.name,
        "budget": robot.budget * length,
        "reserve": robot.reserve * length,
        "travelled": robot.travelled * length,
        "time": robot.time * (taken.seconds_per_time or 1.0),
        "samples": robot.samples,
        "status": robot.status,
        "came_home": robot.home,
        "from_home": None if robot.away is None else robot.away * length,
        "position": [x, y],
    }


def _real(value: float) -> float | None:
    return value if math.isfinite(value) else None
