"""Fields of one's own: functions of points as ground truth."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.errors import InputError
from maipp.typing import Array, Float

# Points per side of the grid on which a function that JAX cannot trace is sampled; between them it is interpolated.
SAMPLED = 257


class FunctionField(eqx.Module):
    """A function of points that JAX can trace, as a field."""

    function: Callable[[Any], Any] = eqx.field(static=True)

    def __call__(self, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
        """Values at points, domain units."""
        return jnp.asarray(self.function(points), points.dtype)


class SampledField(eqx.Module):
    """A function of points as its values on a grid over the domain, bilinear in between."""

    values: Float[Array, "x y"]
    extent: Float[Array, "2"]  # domain units

    def __call__(self, points: Float[Array, "n 2"]) -> Float[Array, " n"]:
        """Values at points, domain units; beyond the domain those of its border."""
        place = jnp.clip(points / self.extent, 0.0, 1.0) * (SAMPLED - 1)
        low = jnp.clip(jnp.floor(place).astype(jnp.int32), 0, SAMPLED - 2)
        (u, v), (i, j) = (place - low).T, low.T
        row = self.values[i, j] * (1 - v) + self.values[i, j + 1] * v
        return row * (1 - u) + (self.values[i + 1, j] * (1 - v) + self.values[i + 1, j + 1] * v) * u


def as_field(field: Any, extent: tuple[float, float]) -> Any:
    """A field that compiled missions can call: as it is where it is a module, else a function of points (n, 2) -> (n,).

    One written in JAX is compiled with the missions; any other, such as one of NumPy, is sampled on a grid of 257 x 257
    points over the domain. Raises `InputError` for what is no such function, and for values that are not finite.
    """
    if field is None or isinstance(field, eqx.Module):
        return field
    if not callable(field):
        raise InputError(f"field: {type(field).__name__} is no field; give a function of points (n, 2) to values (n,)")
    name = getattr(field, "__name__", type(field).__name__)
    try:
        traced = jax.eval_shape(field, jax.ShapeDtypeStruct((3, 2), jnp.result_type(float)))
    except Exception:  # whatever a function raises that was not written for JAX
        return _sampled(field, name, extent)
    if getattr(traced, "shape", None) != (3,):
        raise InputError(f"field {name}: it gives {getattr(traced, 'shape', type(traced))} for 3 points; give (3,)")
    return FunctionField(field)


def _sampled(field: Callable[[Any], Any], name: str, extent: tuple[float, float]) -> SampledField:
    """The function on a grid, asked once for all its points."""
    sides = np.asarray(extent, float)
    place = np.linspace(0.0, 1.0, SAMPLED)
    points = np.stack(np.meshgrid(*(place * side for side in sides), indexing="ij"), axis=-1).reshape(-1, 2)
    try:
        values = np.asarray(field(points), float)
    except Exception as error:
        reason = " ".join(str(error).split())[:200]
        raise InputError(
            f"field {name}: neither JAX nor NumPy points (n, 2) pass through it: {type(error).__name__}: {reason}"
        ) from error
    if values.shape != (len(points),):
        raise InputError(f"field {name}: it gives {values.shape} for {len(points)} points; give ({len(points)},)")
    if not np.isfinite(values).all():
        where = points[~np.isfinite(values)][0]
        raise InputError(f"field {name}: its value at {where[0]:g} {where[1]:g} is not a finite number")
    real = jnp.result_type(float)
    return SampledField(jnp.asarray(values.reshape(SAMPLED, SAMPLED), real), jnp.asarray(sides, real))
