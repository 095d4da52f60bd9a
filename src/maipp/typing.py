"""jaxtyping aliases shared by every module: the shape and the unit of what travels between floors."""

import jaxtyping
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray, UInt

Scalar = Float[Array, ""]
Point = Float[Array, "2"]  # position in domain units
Points = Float[Array, "n 2"]  # positions in domain units
Vector = Float[Array, " n"]
Mask = Bool[Array, " n"]
Index = Int[Array, ""]
Extent = tuple[float, float] | Float[Array, "2"]  # width and height, domain units
Real = float | Float[Array, ""]  # a number of a scenario: a float on the host, an array in compiled code
Key = PRNGKeyArray
Keys = jaxtyping.Key[Array, " b"]  # a typed key for each of a batch

__all__ = [
    "Array",
    "Bool",
    "Extent",
    "Float",
    "Index",
    "Int",
    "Key",
    "Keys",
    "Mask",
    "Point",
    "Points",
    "Real",
    "Scalar",
    "UInt",
    "Vector",
]
