"""What the field will turn out to be: a `Foresight` gives mean and deviation of the true field, given a belief.

The protocol's belief scores a survey; a foresight only has to be right. There is one for each name in `FORESIGHTS`,
`make_foresight` makes it for a scenario.
"""

from maipp.foresight.foresight import Foresight
from maipp.foresight.law import Law
from maipp.foresight.registry import FORESIGHTS, ForesightName, make_foresight

__all__ = ["FORESIGHTS", "Foresight", "ForesightName", "Law", "make_foresight"]
