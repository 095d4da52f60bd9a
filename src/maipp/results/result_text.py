"""A result in words, for whoever was in the field: sentences, and the cells of its tables."""

from typing import Any

from maipp.viz.report_units import number, percent, setting

_WHY = {
    "surprise": "too far from what its surroundings lead to expect",
    "stuck": "the sensor gave one value again and again",
    "withdrawn": "withdrawn by a person",
    "empty": "a value that stands for none",
}


def sentences(told: dict[str, Any]) -> list[str]:
    """What `numbers` says, most important first."""
    unit = f" {told['units']['value']}" if told["units"]["value"] else ""
    left, error, samples = told["uncertainty_left"], told["map_error"], told["samples"]
    out, robots = len(samples["kept_out"]), len(told["robots"])
    counts = f"{_plural(samples['taken'], 'sample')} by {_plural(robots, 'robot')}"
    counts += f", of which {out} {'does' if out == 1 else 'do'} not count" if out else ""
    earlier = samples["before_the_survey"]
    lines = [counts + (f"; besides {_plural(earlier, 'sample')} from before the survey." if earlier else ".")]
    before = f"{number(left['std_before'])}{unit} before the survey"
    lines.append(
        f"Uncertainty left: {number(left['std'])}{unit} instead of {before} "
        f"(standard deviation of the map, root mean square over the area); Tr(P) {number(left['trace'])}, "
        f"{percent(left['trace'], left['trace_before'])} of {number(left['trace_before'])}."
    )
    if error["known"] and error["rmse"] is not None:
        lines.append(f"Map error: {number(error['rmse'])}{unit} (RMSE over the area, against the known truth).")
    else:
        lines.append(
            f"Map error: not known, since the true values are not; about {number(error['expected'])}{unit} is to be "
            "expected, as much as the map is uncertain by, if kernel and noise of the mission are right."
        )
    interest = told["high_interest"]
    if interest["threshold"] is not None:
        possible = interest["not_ruled_out"] - interest["predicted"]
        lines.append(
            f"By the map {percent(interest['predicted'], 1.0)} of the area is of interest ({interest['side']} "
            f"{setting(interest['threshold'])}{unit}); of another {percent(possible, 1.0)} that cannot be ruled out."
        )
    homes = [robot["came_home"] for robot in told["robots"] if robot["came_home"] is not None]
    if homes:
        lines.append(f"{sum(homes)} of {_plural(len(homes), 'robot')} that should come home {_came(sum(homes))}.")
    return lines


def robot_rows(told: dict[str, Any]) -> list[tuple[str, ...]]:
    """A row for every robot, the heading first."""
    units = told["units"]
    seconds = units["time"] == "s"
    heading = ("robot", f"budget ({units['length']})", f"travelled ({units['length']})", "of budget")
    rows: list[tuple[str, ...]] = [(*heading, "minutes" if seconds else "time", "samples", "came home", "status")]
    for robot in told["robots"]:
        rows.append(
            (
                robot["name"],
                number(robot["budget"], 4),
                number(robot["travelled"], 4),
                percent(robot["travelled"], robot["budget"]),
                f"{robot['time'] / 60:.1f}" if seconds else number(robot["time"]),
                str(robot["samples"]),
                came_home(robot, units["length"]),
                robot["status"],
            )
        )
    return rows


def came_home(robot: dict[str, Any], unit: str) -> str:
    """Whether a robot of `numbers` came home."""
    if robot["came_home"] is None:
        return "may end anywhere"
    return "yes" if robot["came_home"] else f"no, {number(robot['from_home'])} {unit} away"


def kept_out_rows(told: dict[str, Any]) -> list[tuple[str, ...]]:
    """A row for every sample that does not count, the heading first; empty where all do."""
    samples, units = told["samples"]["kept_out"], told["units"]
    if not samples:
        return []
    value = f"value ({units['value']})" if units["value"] else "value"
    rows = [("sample", "robot", "time (s)" if units["time"] == "s" else "time", "place", value, "surprise", "why")]
    digits = 6 if units["position"].startswith("degrees") else 1 if units["length"] == "m" else 4
    for each in samples:
        place = ", ".join(f"{coordinate:.{digits}f}" for coordinate in each["position"])
        surprise = "" if each["surprise"] is None else f"{each['surprise']:.1f} std"
        time, size = f"{each['time']:.12g}", f"{each['value']:.6g}"
        rows.append((each["id"], each["robot"], time, place, size, surprise, _WHY[each["why_not"]]))
    return rows


def _came(count: int) -> str:
    return "did" if count else "did so far"


def _plural(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
