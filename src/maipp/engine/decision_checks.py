"""What a planner's `decide` owes: checked while it is compiled, told in one line that says where the planner is."""

import inspect
import traceback
from typing import Any

import jax
import jax.numpy as jnp

from maipp.engine.decision import Decision, Observation, Planner, PyTree
from maipp.errors import InputError
from maipp.typing import Key

# What JAX raises where Python wants a value that is only known when the compiled function runs.
_TRACED = (
    jax.errors.ConcretizationTypeError,
    jax.errors.NonConcreteBooleanIndexError,
    jax.errors.TracerArrayConversionError,
    jax.errors.TracerIntegerConversionError,
)


def decided(planner: Planner, key: Key, observation: Observation, memory: PyTree) -> Decision:
    """The planner's answer. Raises `InputError` where it cannot be compiled, or has another form than promised."""
    try:
        decision: Any = planner.decide(key, observation, memory)
    except _TRACED as error:
        line = _line_of(planner, error)
        raise InputError(
            f"{_named(planner)}: {line}Python needs a value that is only known once the planner runs (an `if`, "
            "`while`, `min`, `float()` or NumPy function on what depends on the observation); use jnp.where, "
            "jnp.minimum, lax.cond or jax.numpy"
        ) from error
    if not isinstance(decision, Decision):
        raise _owes(planner, "a maipp.Decision", f"it gave a {type(decision).__name__}")
    shape, wanted = _shape(decision.waypoints), (planner.waypoints_per_decision, 2)
    if shape != wanted:
        change = "return position[None] for a single one" if shape == (2,) else "or set waypoints_per_decision"
        raise _owes(planner, f"waypoints of shape {wanted}", f"they have {shape}; {change}")
    _same(planner, "message", decision.message, planner.empty_message(), "empty_message()")
    _same(planner, "memory", decision.memory, planner.initial_memory(), "initial_memory()")
    if _shape(decision.stop) != ():
        raise _owes(planner, "stop as one truth value", f"it has the shape {_shape(decision.stop)}")
    return decision


def _same(planner: Planner, name: str, given: PyTree, promised: PyTree, where: str) -> None:
    """Raise where a message or a memory is not as promised: structure, shapes, and types that hold the numbers."""
    have, want = jax.tree.structure(given), jax.tree.structure(promised)
    if have != want:
        raise _owes(planner, f"a {name} of the structure of {where}, {_told(promised)}", f"it is {_told(given)}")
    for new, old in zip(jax.tree.leaves(given), jax.tree.leaves(promised), strict=True):
        to, kind = jnp.result_type(old), jnp.result_type(new)
        real = jnp.issubdtype(kind, jnp.floating) and jnp.issubdtype(to, jnp.floating)
        if _shape(new) != _shape(old) or not (real or jnp.promote_types(kind, to) == to):
            raise _owes(planner, f"a {name} like {where}, {_told(promised)}", f"it is {_told(given)}")


def _told(tree: PyTree) -> str:
    """Shapes and types of a pytree, on one line."""
    if not jax.tree.leaves(tree):
        return "() (nothing)"
    return str(jax.tree.map(lambda leaf: f"{jnp.result_type(leaf)}{list(_shape(leaf))}", tree)).replace("'", "")


def _shape(leaf: Any) -> tuple[int, ...]:
    try:
        return jnp.shape(leaf)
    except TypeError:
        return (-1,)


def _owes(planner: Planner, what: str, instead: str) -> InputError:
    return InputError(f"{_named(planner)}: decide owes {what}; {instead}")


def _named(planner: Planner) -> str:
    """The planner's class, and where its `decide` is."""
    code = inspect.unwrap(type(planner).decide).__code__
    return f"planner {type(planner).__name__} ({code.co_filename}:{code.co_firstlineno})"


def _line_of(planner: Planner, error: BaseException) -> str:
    """The innermost line of the planner's own file that led to an error."""
    file = inspect.getfile(type(planner))
    lines = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f"line {lines[-1].lineno}, `{lines[-1].line}`: " if lines else ""
