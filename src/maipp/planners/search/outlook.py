"""What an agent plans its next legs from."""

from typing import NamedTuple

from maipp.belief import Belief
from maipp.planners.announced.meeting import Rendezvous
from maipp.planners.search.prospect import Prospect
from maipp.typing import Array, Bool, Float


class Ahead(NamedTuple):
    """The next legs of an agent, a measurement at the end of each."""

    offsets: Float[Array, " h"]  # distances to the measurements, domain units
    steps: Float[Array, " h"]  # lengths of the legs, domain units
    affordable: Bool[Array, " h"]  # within its budget


class Outlook(NamedTuple):
    """Where one agent is, and what it believes."""

    position: Float[Array, "2"]  # domain units
    steps: Float[Array, " h"]  # lengths of its next legs, domain units
    affordable: Bool[Array, " h"]  # those within its budget
    belief: Belief  # may count measurements whose values are not known yet
    known: Float[Array, " q"]  # the variance that measured values leave
    inside: Bool[Array, " q"]  # grid points of the survey area
    meeting: Rendezvous | None = None  # where to be at the end; None: anywhere
    remaining: Float[Array, ""] | None = None  # when that is: the budget left, domain units
    prospect: Prospect | None = None  # what is foreseen; None: what the belief expects
