"""Small surveys that compile quickly."""

from pathlib import Path

import pytest

from maipp.surveys.standardise import PreparedSurvey, prepare
from maipp.surveys.survey_io import parse_survey

# Two robots in a square of 1 km with an island and a no-go zone; few nodes, few measurements.
SQUARE = """
name: square
metres: true
area: {type: Polygon, coordinates: [[[0,0],[1000,0],[1000,1000],[0,1000]], [[600,600],[700,600],[700,700],[600,700]]]}
no_go: [[[200,0],[300,0],[300,500],[200,500]]]
robots:
  - {name: one, start: [0, 0], speed: 2, budget_m: 1500}
  - {name: two, start: [50, 50], speed: 1, budget_minutes: 20}
measurement_spacing_m: 300
quantity: salt
unit: g/L
threshold: 12
kernel: {length_scale_m: 300, mean: 10, std: 4}
noise: 0.4
planner: shared-greedy
scenario: {grid: 10, nodes: 40, neighbours: 6}
"""


def prepared_from(text: str, folder: Path = Path()) -> PreparedSurvey:
    """The prepared survey of a mission file's text."""
    return prepare(parse_survey(text, source="mission.yaml", folder=folder))


@pytest.fixture
def square() -> PreparedSurvey:
    return prepared_from(SQUARE)
