"""The lines of the tables: which planner, with which options, under which name in the paper.

A line more is one `Row` more in `OURS`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from maipp.engine import Mission, Planner, draw_missions
from maipp.markdown import typed
from maipp.planners import make_planner
from maipp.scenario import Scenario


@dataclass(frozen=True)
class Row:
    """One line of a table."""

    name: str  # unique, a word that can be typed and be a part of a file's name
    planner: str
    options: Mapping[str, Any] = field(default_factory=dict)  # that differ from the planner's defaults
    paper: str | None = None  # the paper's name of the method; None: not in the paper
    most_trials: int | None = None  # fewer than asked for, where a trial is dear; the table says so
    quick: bool = True  # False: too dear for a quick look, unless it is asked for by name
    by_name: bool = False  # in no table unless it is asked for by name: as dear as many other rows together

    @property
    def label(self) -> str:
        """The planner and its options, as one would type them."""
        return f"`{self.planner}` {self.typed_options}".rstrip()

    @property
    def typed_options(self) -> str:
        """The options as one would type them."""
        return " ".join(f"{key}={typed(value)}" for key, value in self.options.items())

    def drawn(self, scenario: Scenario, *, instances: int, seed: int) -> tuple[Planner, Mission]:
        """The planner made for a scenario, and its missions: one for each instance."""
        planner = make_planner(self.planner, scenario, self.options)
        return planner, draw_missions(scenario, seed=seed, instances=instances, planner=planner)


def _rrt(low: float, high: float) -> Row:
    return Row(f"sga-rrt-{low:g}", "sga-rrt", {"lengths": (low, high)}, f"SGA+RRT({low}, {high})")


# In the paper agents out of range are not counted on, and nobody goes to meet them.
_APART = {"meet": False, "recall": False}


def intent_row(kind: str, steps: int) -> Row:
    """DI(8, j) or TI(8, j): the intent of eight sampled paths of j nodes."""
    return Row(f"{kind}-{steps}", kind, {"paths": 8, "steps": steps} | _APART, f"{kind.upper()}(8, {steps})")


RRT_LONG, RRT_MEDIUM, RRT_SHORT = _rrt(0.9, 1.0), _rrt(0.6, 0.7), _rrt(0.3, 0.4)
CATNIPP = Row("sga-catnipp", "sga-catnipp", {"meet": False}, paper="SGA+CAtNIPP")
DI, TI = intent_row("di", 3), intent_row("ti", 5)
# The paper ranks paths with the others standing still, and tells an intent fitted to all of them.
TI_STAR = Row(
    "ti-5-star",
    "ti-star",
    {"paths": 8, "steps": 5, "rank": "stationary", "share": "samples", "distinct": False, "keep": False} | _APART,
    "TI(8, 5)*",
)
JOINT = Row("receding-horizon-joint", "receding-horizon", {"joint": True}, most_trials=1, quick=False)

OURS = (
    Row("random", "random"),
    Row("untrained", "ti-star", {"weights": "untrained"}, most_trials=3),
    Row("greedy", "greedy"),
    Row("shared-greedy", "shared-greedy"),
    Row("lawnmower", "lawnmower"),
    Row("ti-star", "ti-star"),
    Row("ti-star-deaf", "ti-star", {"listen": False}, most_trials=3),  # what intents are worth
    # What the paper's virtual steps are worth.
    Row("ti-star-reencode", "ti-star", {"mode": "reencode"}, most_trials=1, by_name=True),
    Row("receding-horizon", "receding-horizon"),
    Row("intent-search", "intent-search", most_trials=3),
    JOINT,
)
