"""The words and numbers of a report's page: its facts, key numbers and the table of robots, as HTML."""

import html
from importlib.metadata import PackageNotFoundError, version
from unicodedata import category

import numpy as np

from maipp.typing import Float
from maipp.viz.report_frames import Frames
from maipp.viz.report_survey import Foreseen, SurveyReport
from maipp.viz.report_units import Unit, decimals, length_unit, number, percent, setting, time_unit
from maipp.viz.style import agent_colour, agent_line

# Said once in each report and result.
TRACE = (
    "Uncertainty left, Tr(P): the sum, over the points of a grid where values of interest cannot be ruled out yet, of "
    "the variance there: the square of how far the map may be off, 1 for a point of which nothing is known. It falls "
    "as robots measure; 0 would be a map that is certain."
)
_DASH_ARRAYS = {"-": "none", (0, (5, 1.5)): "6 3", (0, (1, 1)): "2 3"}


def escaped(text: str) -> str:
    """The text as HTML shows it, whatever it holds: control characters and halves of others as U+FFFD."""
    return html.escape(
        "".join("\N{REPLACEMENT CHARACTER}" if category(sign) in ("Cc", "Cs") else sign for sign in text)
    )


def facts(report: SurveyReport) -> str:
    """Who planned what, when and with which settings."""
    episode, scenario = report.episode, report.episode.scenario
    options = " ".join(f"{name}={value}" for name, value in episode.options.items())
    length, bound, geo = length_unit(report), "≤" if report.geo.inverted else "≥", report.geo
    entries = [
        ("Date", report.date),
        ("Planner", f"{episode.planner} {options}".strip()),
        ("Robots", str(len(episode.agents))),
        ("Measured", geo.value_name),
        ("Of high interest", f"{geo.quantity} {bound} {setting(report.threshold)} {geo.unit or ''}".rstrip()),
        ("Measurement every", length.setting(scenario.measurement_interval)),
        ("Length scale of the belief", length.setting(scenario.length_scale)),
        ("Communication range", "unlimited" if scenario.comm_range is None else length.setting(scenario.comm_range)),
        ("Seed", str(episode.seed)),
        ("Made with", f"maipp {_version()}"),
    ]
    rows = "".join(f"<div><dt>{name}</dt><dd>{escaped(value)}</dd></div>" for name, value in entries if value)
    return f'<dl class="facts">{rows}</dl>'


def key_numbers(report: SurveyReport, frames: Frames) -> str:
    """The few numbers that say how the survey ended."""
    episode, length = report.episode, length_unit(report)
    count = sum(len(agent.measurement_y) for agent in episode.agents)
    before, after = frames.trace[0], frames.trace[-1]
    spread = f"; standard deviation in it {_valued(frames.spread[-1], report)} (root mean square)"
    spread = spread if frames.area[-1] > 0 else ""
    cards = [
        ("Uncertainty left", f"Tr(P) {number(after)}", f"{percent(after, before)} of {number(before)} at the start"),
        (
            "Predicted area of high interest",
            percent(frames.area[-1], 1.0),
            f"of the survey area{spread}",
        ),
    ]
    expected = _valued(frames.expected_error[-1], report)
    if not report.truth_known:
        cards.append(
            ("Map error", "not known", f"about {expected} is to be expected (RMSE): what the map is uncertain by")
        )
    else:
        cards.append(("Map error", _valued(frames.rmse[-1], report), f"RMSE over the survey area; {expected} expected"))
        found = frames.found[-1]
        share = percent(found, 1.0) if np.isfinite(found) else "there is none"
        cards.append(("True area of high interest", share, "lies in the predicted one" if np.isfinite(found) else ""))
    if report.foreseen is not None:
        cards.insert(3, _foreseen(report, report.foreseen))  # beside the belief's
    duration = Unit(time_unit(report).factor, time_unit(report).name or "units of time").text(episode.end)
    cards.append(("Travelled", length.text(episode.distance), f"by the team, in {duration}"))
    known = 0 if report.prior is None else len(report.prior[1])
    earlier = f", besides {known} earlier sample{'' if known == 1 else 's'}" if known else ""
    cards.append(("Measurements", str(count), f"after {episode.decisions} decisions{earlier}"))
    items = "".join(
        f'<div class="card"><dt>{name}</dt><dd><strong>{escaped(value)}</strong><span>{escaped(more)}</span></dd></div>'
        for name, value, more in cards
    )
    return f'<dl class="cards">{items}</dl><p class="explained">{escaped(TRACE)}</p>'


def _foreseen(report: SurveyReport, foreseen: Foreseen) -> tuple[str, str, str]:
    """How far the map of a foresight is off, or may be."""
    episode = report.episode
    inside, geo = episode.inside, report.geo
    expected = _valued(float(geo.to_user_std(_root_mean_square(foreseen.std[inside]))), report)
    heading = f"Map error, {foreseen.name}"
    if not report.truth_known:
        return heading, "not known", f"about {expected} is to be expected (RMSE) of the map that is foreseen"
    error = float(geo.to_user_std(_root_mean_square((foreseen.mean - episode.truth)[inside])))
    return heading, _valued(error, report), f"RMSE of the map that is foreseen; {expected} expected"


def _root_mean_square(values: Float[np.ndarray, " p"]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def summary(report: SurveyReport) -> str:
    """The sentences that come first; nothing where there are none."""
    return "".join(f'<p class="summary">{escaped(text)}</p>' for text in report.summary)


def kept_out(report: SurveyReport) -> str:
    """The samples that do not count, one row each; nothing where all do."""
    if not report.kept_out:
        return ""
    heading, *lines = report.kept_out
    head = "".join(f'<th scope="col">{escaped(text)}</th>' for text in heading)
    rows = "".join(f"<tr>{''.join(f'<td>{escaped(cell)}</td>' for cell in line)}</tr>" for line in lines)
    return (
        '<section aria-label="Samples that do not count"><h2>Samples that do not count</h2>'
        '<div class="scroll" tabindex="0" role="region" aria-label="Table of samples that do not count">'
        f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div></section>"
    )


def warnings(report: SurveyReport) -> str:
    """What to know before trusting the numbers; nothing where there are no warnings."""
    if not report.warnings:
        return ""
    items = "".join(f"<li>{escaped(text)}</li>" for text in report.warnings)
    return f'<section class="warnings" aria-label="Warnings"><h2>Warnings</h2><ul>{items}</ul></section>'


def robot_table(report: SurveyReport) -> str:
    """What every robot did, one row each."""
    episode, length, time = report.episode, length_unit(report), time_unit(report)
    corners = report.geo.to_user(np.array([[0.0, 0.0], episode.scenario.extent]))
    digits = decimals(float(np.ptp(corners, axis=0).max()), 5 if report.geo.geographic else 4)
    unit = f" ({time.name})" if time.name else ""
    place = ", ".join(label.partition(" (")[0].partition(",")[0] for label in (report.x_label, report.y_label))
    heads = [
        "Robot",
        *(["Came home"] if report.homes else []),
        f"Start ({place})",
        f"Budget ({length.name})",
        f"Travelled ({length.name})",
        f"Time{unit}",
        "Measurements",
        "Decisions",
        f"End ({place})",
    ]
    rows = []
    for index, agent in enumerate(episode.agents):
        start, end = (report.geo.to_user(place[None])[0] for place in (agent.start, agent.route[-1]))
        cells = [
            *([report.homes[index]] if report.homes else []),
            f"{start[0]:.{digits}f}, {start[1]:.{digits}f}",
            number(agent.budget * length.factor, 4),
            number(agent.distance * length.factor, 4),
            number(float(agent.route_time[-1]) * time.factor),
            str(len(agent.measurement_y)),
            str(agent.decisions),
            f"{end[0]:.{digits}f}, {end[1]:.{digits}f}",
        ]
        name = f'<th scope="row">{swatch(index)}<bdi>{escaped(report.robots[index])}</bdi></th>'
        rows.append(f"<tr>{name}{''.join(f'<td>{escaped(cell)}</td>' for cell in cells)}</tr>")
    head = "".join(f'<th scope="col">{escaped(text)}</th>' for text in heads)
    return (
        '<div class="scroll" tabindex="0" role="region" aria-label="Table of robots">'
        f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def swatch(index: int) -> str:
    """A piece of a robot's line, as a picture."""
    dashes = _DASH_ARRAYS[agent_line(index)]
    return (
        '<svg class="swatch" viewBox="0 0 24 8" aria-hidden="true"><path d="M0 4H24" '
        f'stroke="{agent_colour(index)}" stroke-width="3" stroke-dasharray="{dashes}"/></svg>'
    )


def _valued(value: float, report: SurveyReport) -> str:
    return f"{number(float(value))} {report.geo.unit or ''}".rstrip()


def _version() -> str:
    try:
        return version("maipp")
    except PackageNotFoundError:  # run from a source tree
        return "from a source tree"
