"""jaxtyping aliases shared by every module: the shape and the unit of what travels between floors."""

from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

Scalar = Float[Array, ""]
Point = Float[Array, "2"]  # position in domain units
Points = Float[Array, "n 2"]  # positions in domain units
Vector = Float[Array, " n"]
Mask = Bool[Array, " n"]
Index = Int[Array, ""]
Key = PRNGKeyArray

__all__ = ["Array", "Bool", "Float", "Index", "Int", "Key", "Mask", "Point", "Points", "Scalar", "Vector"]
