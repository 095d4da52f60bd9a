"""The rehearsal in one picture: uncertainty left, error and share found over the size of the team."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from maipp.surveys.rehearsal import RehearsalResult
from maipp.surveys.spread import spread
from maipp.viz.style import LARGE, MEDIUM, SMALL, agent_colour, new_figure


def draw_rehearsal(result: RehearsalResult, dpi: int = 160) -> Figure:
    """Means with bars from the 10th to the 90th percentile, one line for each planner."""
    unit = f" ({result.survey.unit})" if result.survey.unit else ""
    panels = [("Uncertainty left, share of initial Tr(P)", "trace_share"), (f"Error of the map, RMSE{unit}", "rmse")]
    if result.survey.threshold is not None:
        panels.append(("Area of interest found", "found"))
    figure = new_figure(3.2 * len(panels) + 0.4, 3.5, dpi)
    planners = list(dict.fromkeys(team.planner for team in result.teams))
    for index, (title, measure) in enumerate(panels):
        axes = figure.add_subplot(1, len(panels), index + 1)
        for number, planner in enumerate(planners):
            teams = [team for team in result.teams if team.planner == planner]
            rows = np.array([spread(getattr(team, measure)) for team in teams])
            # Beside each other, so that their bars can be told apart.
            at = np.array([team.robots for team in teams]) + 0.08 * (number - (len(planners) - 1) / 2)
            bars = np.maximum(np.stack([rows[:, 0] - rows[:, 2], rows[:, 3] - rows[:, 0]]), 0.0)
            axes.errorbar(at, rows[:, 0], bars, color=agent_colour(number), marker="o", ms=4, capsize=2, label=planner)
        axes.set_title(title, fontsize=MEDIUM, loc="left")
        axes.set_xlabel("robots", fontsize=SMALL)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_ylim(bottom=0)
        if measure != "rmse":
            axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.tick_params(labelsize=SMALL)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        if index == 0 and len(planners) > 1:
            axes.legend(fontsize=SMALL, frameon=False)
    plural = "s" if result.fields > 1 else ""
    heading = f"{result.survey.name}: mean and 10-90 % of {result.fields} rehearsal{plural}"
    figure.suptitle(heading, fontsize=LARGE, weight="bold", x=0.01, ha="left")
    figure.tight_layout(rect=(0, 0, 1, 0.98))
    return figure
