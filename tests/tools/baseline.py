"""Times as multiples of a fixed kernel, compared with those kept in the repository: machines of any speed compare.

The kernel is what every decision begins with: a Matern covariance, its Cholesky factor, and a solve for the grid. A
change of the engine shows as a changed multiple, a slower machine, or a busier one, hardly does.
"""

import json
import statistics
import timeit
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from maipp.bench.provenance import machine, versions
from maipp.errors import InputError
from maipp.files import write_atomic

BASELINE = Path(__file__).parent / "baseline.json"
_FORMAT = "maipp-bench-baseline"
_POINTS, _QUERIES, _ROUNDS = 48, 900, 40  # a team's measurements, the grid, repetitions in one call


Multiples = dict[str, dict[str, float]]  # by planner and hot path: its time as a multiple of the kernel's


class Compared(NamedTuple):
    """A hot path against the baseline."""

    planner: str
    path: str
    multiple: float  # of the kernel's time
    before: float | None  # the baseline's; None where it has none
    change: float | None  # multiple / before: above 1 is slower


def kernel_seconds(repeat: int = 15) -> float:
    """The kernel's time, seconds, compilation excluded: the median of some calls."""
    import jax
    import jax.numpy as jnp
    from jax import lax

    from maipp.belief import Matern32, condition

    points = jax.random.uniform(jax.random.key(0), (_POINTS, 2))
    grid = jax.random.uniform(jax.random.key(1), (_QUERIES, 2))
    kernel, every = Matern32(0.45, 1.0), jnp.ones(_POINTS, bool)

    @jax.jit
    def rounds(points: Any) -> Any:
        def again(_: Any, total: Any) -> Any:
            # Each round depends on the one before, so that none is left out.
            belief = condition(kernel, points + 1e-9 * total, points[:, 0], every, grid, 1e-6)
            return jnp.sum(belief.variance)

        return lax.fori_loop(0, _ROUNDS, again, jnp.zeros(()))

    jax.block_until_ready(rounds(points))
    return statistics.median(timeit.repeat(lambda: jax.block_until_ready(rounds(points)), number=1, repeat=repeat))


def compare(found: Multiples, baseline: Mapping[str, Any]) -> list[Compared]:
    """Every hot path beside what the baseline has of it."""
    rows = []
    for planner, paths in found.items():
        for path, multiple in paths.items():
            before = baseline["multiples"].get(planner, {}).get(path)
            rows.append(Compared(planner, path, multiple, before, None if before is None else multiple / before))
    return rows


def slower(rows: Sequence[Compared], tolerance: float) -> list[Compared]:
    """The hot paths that take more than `tolerance` times what they took."""
    return [row for row in rows if row.change is not None and row.change > tolerance]


def load_baseline(path: Path) -> dict[str, Any]:
    """The baseline in a file; an empty one where there is no file. Raises `InputError` for a file of another kind."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {"format": _FORMAT, "multiples": {}}
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    if not isinstance(document, dict) or document.get("format") != _FORMAT:
        raise InputError(f"{path}: not a baseline; write one with --update")
    return document


def save_baseline(found: Multiples, path: Path) -> None:
    """Keep these as the baseline; what was not timed keeps its own."""
    multiples = load_baseline(path)["multiples"]
    for planner, paths in found.items():
        multiples.setdefault(planner, {}).update({name: float(f"{multiple:.4g}") for name, multiple in paths.items()})
    document = {"format": _FORMAT, "machine": machine(), "versions": versions(), "multiples": multiples}
    write_atomic(path, json.dumps(document, indent=1) + "\n")
