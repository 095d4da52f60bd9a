"""jaxtyping aliases shared by every module: the shape and the unit of what travels between floors."""

import jaxtyping
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

Scalar = Float[Array, ""]
Point = Float[Array, "2"]  # position in domain units
Points = Float[Array, "n 2"]  # positions in domain units
Vector = Float[Array, " n"]
Mask = Bool[Array, " n"]
Index = Int[Array, ""]
Key = PRNGKeyArray
Keys = jaxtyping.Key[Array, " b"]  # a typed key for each of a batch

__all__ = ["Array", "Bool", "Float", "Index", "Int", "Key", "Keys", "Mask", "Point", "Points", "Scalar", "Vector"]
