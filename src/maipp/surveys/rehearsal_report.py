"""A rehearsal in words, as a table, CSV, Markdown and a figure: what can the team expect, is another robot worth it?"""

import csv
import io
import math
from pathlib import Path

import numpy as np
from rich import box
from rich.table import Table

from maipp.files import write_atomic
from maipp.surveys.rehearsal import REFITTED, RehearsalResult, RehearsedTeam
from maipp.surveys.rehearsal_figure import draw_rehearsal
from maipp.surveys.spread import Spread, spread
from maipp.typing import Float
from maipp.viz.style import save_figure

# An improvement below this share is called small, however sure.
_CLEAR = 0.10
# Standard errors of the paired differences from which a difference is told as one.
_SURE = 2.0


_COLUMNS = ("planner", "robots", "field", "trace", "trace_before", "trace_share", "rmse", "rmse_before")
_MORE_COLUMNS = ("found", "found_before", "distance_m", "minutes")


def to_csv(result: RehearsalResult) -> str:
    """One row for every planner, team and field; empty cells where a field has nothing of high interest, and for the
    maps of a foresight where it drew none."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    maps = tuple(dict.fromkeys(name for team in result.teams for name in team.maps))
    writer.writerow((*_COLUMNS, *_MORE_COLUMNS, *maps))
    for team in result.teams:
        columns = [team.trace, team.trace_before, team.trace_share, team.rmse, team.rmse_before]
        columns += [team.found, team.found_before, team.distance, team.minutes]
        columns += [_map(team, name) for name in maps]
        for index, numbers in enumerate(zip(*columns, strict=True)):
            cells = [f"{number:.6g}" if math.isfinite(number) else "" for number in numbers]
            writer.writerow([team.planner, team.robots, index, *cells])
    return text.getvalue()


def rows(result: RehearsalResult, between: str = " ") -> list[tuple[str, ...]]:
    """The cells of the table, its heading first: mean and standard deviation, `between`, and the 10-90 % range."""
    unit = f" ({result.survey.unit})" if result.survey.unit else ""
    foretold = () if result.foresight is None else (f"RMSE, {result.foresight}",)
    table = [("planner", "robots", "Tr(P)", "of initial", f"RMSE{unit}", *foretold, "found", "minutes")]
    for team in result.teams:
        table.append(
            (
                team.planner,
                str(team.robots),
                _cell(spread(team.trace), between),
                _cell(spread(team.trace_share), between, percent=True),
                _cell(spread(team.rmse), between),
                *(_cell(spread(_map(team, f"{result.foresight}_rmse")), between) for _ in foretold),
                _cell(spread(team.found), between, percent=True),
                f"{spread(team.minutes).mean:.0f}",
            )
        )
    return table


def _map(team: RehearsedTeam, name: str) -> Float[np.ndarray, " f"]:
    """One score of the maps, NaN where the team has none."""
    return team.maps.get(name, np.full(len(team.rmse), np.nan))


def summary_table(result: RehearsalResult) -> Table:
    """The table for a terminal."""
    heading, *lines = rows(result, between="\n")
    caption = "mean \u00b1 standard deviation over fields (10 % to 90 %)"
    table = Table(title=_title(result), caption=caption, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for index, name in enumerate(heading):
        table.add_column(name, justify="left" if index == 0 else "right", no_wrap=True)
    for line in lines:
        table.add_row(*line)
    return table


def words(result: RehearsalResult) -> list[str]:
    """What the rehearsal says, in sentences: the best planner, and what each further robot adds."""
    planners = list(dict.fromkeys(team.planner for team in result.teams if not team.planner.endswith(REFITTED)))
    largest = max(team.robots for team in result.teams)
    best = min(planners, key=lambda name: float(_team(result, name, largest).trace.mean()))
    sentences = []
    if len(planners) > 1:
        sentences.append(_best_planner(result, planners, best, largest))
    teams = [team for team in result.teams if team.planner == best]
    first = teams[0]
    before, after = spread(first.rmse_before).mean, spread(first.rmse).mean
    unit = f" {result.survey.unit}" if result.survey.unit else ""
    sentences.append(
        f"{_robots(first.robots)} with {best}: the error falls from {before:.3g} to {after:.3g}{unit} (RMSE)"
        + _found(first.found_before, first.found)
        + "."
    )
    sentences += [_worth(less, more, unit) for less, more in zip(teams, teams[1:], strict=False)]
    if result.foresight is not None:
        sentences.append(_foretold(teams[-1], result.foresight, unit))
    refitted = [team for team in result.teams if team.planner == best + REFITTED and team.robots == largest]
    return sentences + [_refitted(_team(result, best, largest), team, unit) for team in refitted]


def _refitted(fixed: RehearsedTeam, team: RehearsedTeam, unit: str) -> str:
    """What refitting the kernel under way does to the error of the map; the traces are by different kernels."""
    gain, se = _gain(fixed.rmse, team.rmse)
    error = f"{spread(team.rmse).mean:.3g}{unit}"
    return (
        f"Kernel refitted under way, {_robots(team.robots)} with {fixed.planner}, on fields of uncertain length scale: "
        f"the error changes by {-gain:+.0%} (\u00b1 {se:.0%}) to {error}, {_verdict(gain, se)}. "
        "Its Tr(P) is by another kernel and cannot be compared."
    )


def _foretold(team: RehearsedTeam, foresight: str, unit: str) -> str:
    """What the foresight's map is worth beside the belief's, and how often the intervals of either hold."""
    gain, se = _gain(team.rmse, _map(team, f"{foresight}_rmse"))
    held = [f"{spread(_map(team, f'{whose}_95')).mean:.0%}" for whose in (foresight, "belief")]
    return (
        f"The map of the foresight {foresight}, {_robots(team.robots)} with {team.planner}: the error changes by "
        f"{-gain:+.0%} (\u00b1 {se:.0%}) to {spread(_map(team, f'{foresight}_rmse')).mean:.3g}{unit}, "
        f"{_verdict(gain, se)}; {held[0]} of the truth lies within its 95 % intervals, {held[1]} within the belief's."
    )


def _worth(less: RehearsedTeam, more: RehearsedTeam, unit: str) -> str:
    """Whether the larger of two teams is worth it, judged by the error of the map and by the uncertainty left."""
    (error, error_se), (left, left_se) = _gain(less.rmse, more.rmse), _gain(less.trace, more.trace)
    return (
        f"{_robots(more.robots)} instead of {less.robots}: the error changes by {-error:+.0%} (\u00b1 {error_se:.0%}) "
        f"to {spread(more.rmse).mean:.3g}{unit}, {_verdict(error, error_se)}; the uncertainty left by {-left:+.0%} "
        f"(\u00b1 {left_se:.0%}), {_verdict(left, left_se)}{_found(less.found, more.found)}."
    )


def _verdict(gain: float, error: float) -> str:
    """What a measure that falls by a share, with this standard error, amounts to."""
    if abs(gain) <= _SURE * error:
        return "no gain that these rehearsals show"
    return "a loss" if gain < 0 else "a clear gain" if gain >= _CLEAR else "a small gain"


def _gain(less: Float[np.ndarray, " f"], more: Float[np.ndarray, " f"]) -> tuple[float, float]:
    """By what share of its mean a measure falls, and the standard error of that; fields are paired."""
    base = max(float(less.mean()), 1e-12)
    difference = (less - more) / base
    error = float(difference.std(ddof=1) / math.sqrt(len(difference))) if len(difference) > 1 else math.inf
    return float(difference.mean()), error


def _best_planner(result: RehearsalResult, planners: list[str], best: str, robots: int) -> str:
    winner = _team(result, best, robots)
    parts = []
    for name in planners:
        if name != best:
            gain, error = _gain(_team(result, name, robots).trace, winner.trace)
            sure = "" if gain > _SURE * error else ", which these rehearsals do not tell apart"
            parts.append(f"{gain:.0%} (\u00b1 {error:.0%}) less than {name}{sure}")
    return f"{best} leaves the least uncertainty with {_robots(robots)}: {'; '.join(parts)}."


def _team(result: RehearsalResult, planner: str, robots: int) -> RehearsedTeam:
    return next(team for team in result.teams if (team.planner, team.robots) == (planner, robots))


def _found(before: Float[np.ndarray, " f"], after: Float[np.ndarray, " f"]) -> str:
    first, last = spread(before).mean, spread(after).mean
    return "" if math.isnan(last) else f", and {last:.0%} instead of {first:.0%} of the area of interest is found"


def _robots(count: int) -> str:
    return f"{count} robot{'s' if count > 1 else ''}"


def _cell(values: Spread, between: str, *, percent: bool = False) -> str:
    if math.isnan(values.mean):
        return "-"

    def number(value: float) -> str:
        return f"{value:.0%}" if percent else f"{value:.3g}"

    middle = f"{number(values.mean)} \u00b1 {number(values.std)}"
    return f"{middle}{between}({number(values.low)} to {number(values.high)})"


def _title(result: RehearsalResult) -> str:
    plural = "s" if result.fields > 1 else ""
    return f"{result.survey.name}: {result.fields} rehearsal{plural} on {result.on}"


def markdown(result: RehearsalResult) -> str:
    """The rehearsal as a page: the sentences, the table, and what its columns mean."""
    heading, *lines = rows(result)
    table = ["| " + " | ".join(heading) + " |", "| --- | " + " | ".join(["---:"] * (len(heading) - 1)) + " |"]
    table += ["| " + " | ".join(line) + " |" for line in lines]
    sentences = "\n".join(f"- {sentence}" for sentence in words(result))
    warned = "\n".join(f"- {warning}" for warning in result.warnings)
    return (
        f"# {_title(result)}\n\n{sentences}\n\n" + "\n".join(table) + "\n\n"
        "Each cell: mean \u00b1 standard deviation over the rehearsals (10 % to 90 % of them). Tr(P) is the sum of the "
        "posterior variances over the area where high values cannot be ruled out yet, in units of the prior variance; "
        "`of initial` its share of what it was before the survey. RMSE is the error of the predicted map. `found` is "
        "the share of the true area of interest where the predicted value reaches the threshold.\n"
        + (f"\nWarnings:\n\n{warned}\n" if warned else "")
    )


def write_report(result: RehearsalResult, folder: Path) -> list[str]:
    """Write rehearsal.csv, rehearsal.md and rehearsal.png to the folder; gives their names."""
    write_atomic(folder / "rehearsal.csv", to_csv(result))
    write_atomic(folder / "rehearsal.md", markdown(result))
    save_figure(draw_rehearsal(result), folder / "rehearsal.png")
    return ["rehearsal.csv", "rehearsal.md", "rehearsal.png"]
