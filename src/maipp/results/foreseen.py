"""What a foresight expects of the true field, from all that a survey measured."""

import numpy as np

from maipp.engine.episode import Episode
from maipp.fields.mixture import evaluation_grid
from maipp.foresight import ForesightName, make_foresight
from maipp.results.taken import Beliefs
from maipp.viz.report_survey import Foreseen


def foreseen(episode: Episode, beliefs: Beliefs, name: ForesightName) -> Foreseen:
    """The map that the foresight of this name draws, for a survey's report."""
    scenario = episode.scenario
    grid = np.asarray(evaluation_grid(scenario.grid, scenario.extent))
    mean, std = beliefs(grid, make_foresight(name, scenario))
    return Foreseen(name, mean, std)
