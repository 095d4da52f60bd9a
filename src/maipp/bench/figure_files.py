"""The files of `maipp benchmark figures`: pictures, numbers, and what these say of the paper's claims."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np
import pandas as pd
from jax import lax

from maipp.bench.command import command, flags_of, footer, wall_time
from maipp.bench.drawings import draw_curves, draw_intents, draw_stability, save_figure
from maipp.bench.intents import KINDS, Stability, measure, sampled_paths, stability_table, verdicts
from maipp.bench.provenance import machine, versions
from maipp.bench.tables import TABLES, Row
from maipp.bench.tidy_csv import compressed, csv_text, short
from maipp.engine import Mission, State, run_missions
from maipp.engine.episode import Episode
from maipp.engine.finite import instance_and_trial, refuse_non_finite
from maipp.engine.observe import time_tolerance
from maipp.engine.score import trace_over_time
from maipp.files import make_folder, write_atomic
from maipp.scenario import Scenario
from maipp.typing import Array, Float
from maipp.viz import save_overview

SURVEY, INTENTS, CURVES, STABILITY = "survey.png", "intents.png", "curves.png", "stability.png"
CURVES_CSV, PAGE = "curves.csv.gz", "figures.md"
# The planner in Fig. 1, and the decision in Fig. 3: late enough that the agent has a belief, early enough that all
# paths have budget left.
_SURVEYED, _DECISION = "intent-paths", 9

Told = Callable[[str], None]


@dataclass(frozen=True)
class FigurePlan:
    """What to draw."""

    scenario: Scenario = Scenario()
    instances: int = 30
    seed: int = 0
    rows: tuple[Row, ...] = tuple(row for row in TABLES["table1"].chosen(()) if row.quick)  # of the curves


def write_figures(plan: FigurePlan, folder: Path, told: Told = lambda _: None) -> list[Path]:
    """Draw everything into the folder, made if need be; gives the paths. `told` hears what is being worked on.

    Raises `InputError` where a file cannot be written.
    """
    begun = time.perf_counter()
    make_folder(folder)
    told("one survey")
    save_overview(_survey(plan), folder / SURVEY)
    told("one decision's intents")
    sampled = sampled_paths(plan.scenario, paths=8, steps=5, decision=_DECISION, seed=plan.seed)
    save_figure(draw_intents(sampled, plan.scenario.extent), folder / INTENTS)
    parts = []
    for row in plan.rows:
        told(f"curve of {row.name}")
        parts.append(trace_curve(row, plan.scenario, instances=plan.instances, seed=plan.seed))
    curves = pd.concat(parts)
    words = _words(plan)
    save_figure(draw_curves(curves, words), folder / CURVES)
    write_atomic(folder / CURVES_CSV, compressed(csv_text(curves, {"distance": short})))
    found = []
    for kind, lengths in KINDS.items():
        for length in lengths:
            told(f"stability of {kind}, {length}")
            found.append(measure(kind, length, plan.scenario, instances=plan.instances, seed=plan.seed))
    save_figure(draw_stability(found, words), folder / STABILITY)
    write_atomic(folder / PAGE, figures_page(plan, found, out=folder.name, seconds=time.perf_counter() - begun))
    return [folder / name for name in (SURVEY, INTENTS, CURVES, CURVES_CSV, STABILITY, PAGE)]


def trace_curve(row: Row, scenario: Scenario, *, instances: int, seed: int) -> pd.DataFrame:
    """What a row leaves on the way, from its missions: one per instance.

    Columns are row, planner and options (names), instance, distance (travelled by each agent, domain units) and trace,
    Tr(P) of the pooled belief. All agents have speed 1 here, so the distance that an agent on its way has
    travelled is the time.
    """
    planner, missions = row.drawn(scenario, instances=instances, seed=seed)
    states = run_missions(planner, missions, jax.random.key(seed))
    distance = np.arange(scenario.measurements_per_agent + 1) * scenario.measurement_interval
    # Times are sums of float32 legs: each instant includes all of its own measurements.
    traces = np.asarray(_traces(missions, states, distance + time_tolerance(np.asarray(scenario.speeds))), np.float64)
    refuse_non_finite({"Tr(P)": traces}, instance_and_trial(1))
    about = {"row": row.name, "planner": row.planner, "options": row.typed_options}
    places = {"instance": np.repeat(np.arange(instances), len(distance)), "distance": np.tile(distance, instances)}
    return pd.DataFrame(about | places | {"trace": traces.reshape(-1)})


@jax.jit
def _traces(missions: Mission, states: State, times: Float[Array, " d"]) -> Float[Array, "instances d"]:
    return lax.map(lambda pair: trace_over_time(pair[0], pair[1], times), (missions, states))


def figures_page(plan: FigurePlan, found: Sequence[Stability], *, out: str, seconds: float) -> str:
    """The page: pictures, the table of stability, the paper's claims, and the command."""
    blocks = [
        f"![One survey]({SURVEY})",
        f"*One survey by `{_SURVEYED}` (the four maps of the paper's Fig. 1).*",
        f"![Intents]({INTENTS})",
        "*Both Gaussians fitted to the same sampled paths (the paper's Fig. 3); star: the agent, squares: ends.*",
        f"![Tr(P) over distance]({CURVES})",
        f"*Mean Tr(P) on the way, {_words(plan)}; bands: standard error over instances. Numbers: "
        f"[{CURVES_CSV}]({CURVES_CSV}).*",
        f"![Stability of intents]({STABILITY})",
        f"Symmetric KL divergence between successive intents of one agent, in nats, and final Tr(P); {_words(plan)}, "
        "mean ± standard error over instances. For SGA+RRT it is that of Gaussians fitted to the announced "
        "measurements. KL is heavy-tailed (an intent that jumps has a large one), so its median over all pairs is "
        "there too.",
        stability_table(found),
        "The paper's claims, each confirmed or denied only where all the differences that it rests on are beyond "
        "chance (Wilcoxon's signed-rank test on the same instances, two-sided, 0.05):",
        verdicts(found),
        *footer(
            command("figures", out, flags_of(plan, "budget"), flags_of(FigurePlan(), "budget")),
            [(machine(), versions())],
            wall_time(seconds, "the figures"),
        ),
    ]
    return "\n\n".join(blocks) + "\n"


def _words(plan: FigurePlan) -> str:
    scenario = plan.scenario
    return f"{scenario.agents} agents, budget {scenario.budget:g}, {plan.instances} instances, seed {plan.seed}"


def _survey(plan: FigurePlan) -> Episode:
    planner, missions = Row(_SURVEYED, _SURVEYED).drawn(plan.scenario, instances=1, seed=plan.seed)
    states = run_missions(planner, missions, jax.random.key(plan.seed))
    return Episode.from_state(plan.scenario, _SURVEYED, {}, plan.seed, missions, states)
