"""Intent stability: how far an agent's next intent is from its last, and whether that decides how the survey ends.

Source: Yang et al. 2023, Sec. V-B: longer paths make less stable intents; SGA+RRT and DI do best with the shortest, TI
with those of medium length (6 nodes) all the same.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import jax
import numpy as np

from maipp.bench.intent_history import divergences, intents_told
from maipp.bench.page import mean_and_error, shown, three
from maipp.bench.paired import Paired, paired
from maipp.bench.rows import Row, known_rows
from maipp.engine.score import score_missions
from maipp.markdown import markdown_table
from maipp.scenario import Scenario
from maipp.typing import Float

NODES = (3, 6, 9)  # of the sampled paths: j
KINDS = {
    "TI": {j: known_rows()[f"ti-{j}"] for j in NODES},
    "DI": {j: known_rows()[f"di-{j}"] for j in NODES},
    # By the most measurements that a path announces.
    "SGA+RRT": {j: known_rows()[f"sga-rrt-{length}"] for j, length in ((2, 0.3), (4, 0.6), (5, 0.9))},
}
_LEVEL = 0.05  # of the tests that a verdict rests on


@dataclass(frozen=True)
class Stability:
    """One planner with paths of one length."""

    kind: str  # a key of KINDS
    length: int  # nodes of a path, or measurements announced
    row: Row
    divergence: Float[np.ndarray, "instances 1"]  # symmetric KL of successive intents, mean of each mission, nats
    median: float  # of all pairs of all missions, nats
    trace: Float[np.ndarray, "instances 1"]  # final Tr(P) of the pooled belief


def measure(kind: str, length: int, scenario: Scenario, *, instances: int, seed: int) -> Stability:
    """Run the row of this kind and length on one mission per instance."""
    row = KINDS[kind][length]
    planner, missions = row.drawn(scenario, instances=instances, seed=seed)
    history = intents_told(planner, missions, jax.random.key(seed))
    kl = divergences(history, scenario.agents)
    trace = np.asarray(score_missions(missions, history.states).trace, np.float64)
    means = np.array([pairs.mean() if len(pairs) else math.nan for pairs in kl])
    return Stability(kind, length, row, means[:, None], float(np.median(np.concatenate(kl))), trace[:, None])


def stability_table(found: Sequence[Stability]) -> str:
    """Markdown: divergence and final Tr(P) of each kind and length."""
    rows = []
    for one in found:
        unit = "measurements" if one.kind == "SGA+RRT" else "nodes"
        kl, trace = (shown(values[np.isfinite(values[:, 0])]) for values in (one.divergence, one.trace))
        rows.append([f"{one.kind}, {one.length} {unit}", f"`{one.row.name}`", kl, three(one.median), trace])
    return markdown_table(["paths", "row", "KL, mean", "KL, median", "Tr(P)"], rows, left=2)


def verdicts(found: Sequence[Stability]) -> str:
    """Markdown: each claim of the paper, whether these surveys confirm it, and the paired differences it rests on."""
    lines = []
    for kind, lengths in KINDS.items():
        by_length = {one.length: one for one in found if one.kind == kind}
        if set(by_length) != set(lengths):
            continue
        short, medium, long = (by_length[length] for length in sorted(lengths))
        rises = [_paired_kl(medium, short), _paired_kl(long, medium)]
        words = ", ".join(map(_difference, rises))
        lines.append(
            f"- {kind}: longer paths make less stable intents: **{_verdict(rises)}** (KL rises by {words}, from "
            f"{short.length} to {medium.length} and from {medium.length} to {long.length})."
        )
        best, others = (medium, (short, long)) if kind == "TI" else (short, (medium, long))
        gains = [paired(other.trace, best.trace) for other in others]
        words = ", ".join(
            f"{_difference(gain)} more with {other.length}" for gain, other in zip(gains, others, strict=True)
        )
        name = (
            f"paths of medium length ({best.length}) win" if kind == "TI" else f"the shortest paths ({best.length}) win"
        )
        lines.append(f"- {kind}: {name}: **{_verdict(gains)}** (Tr(P): {words}).")
        if kind == "TI":
            despite = _verdict([rises[0], *gains])
            lines.append(f"- TI: paths of medium length win although their intents are less stable: **{despite}**.")
    return "\n".join(lines)


def _paired_kl(more: Stability, less: Stability) -> Paired:
    """The difference of divergences over the missions in which both have successive intents."""
    both = np.isfinite(more.divergence[:, 0]) & np.isfinite(less.divergence[:, 0])
    return paired(more.divergence[both], less.divergence[both])


def _verdict(differences: Sequence[Paired]) -> str:
    """Confirmed where all differences are positive beyond chance, denied where one is negative beyond chance."""
    clear = [test.p is not None and test.p < _LEVEL for test in differences]
    if all(sure and test.mean > 0 for sure, test in zip(clear, differences, strict=True)):
        return "confirmed"
    if any(sure and test.mean < 0 for sure, test in zip(clear, differences, strict=True)):
        return "denied"
    return "not decided"


def _difference(test: Paired) -> str:
    return mean_and_error(test.mean, test.se) + ("" if test.p is None else f" (p = {test.p:.2g})")
