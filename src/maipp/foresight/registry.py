"""Foresights by name."""

from typing import Literal, get_args

from maipp.errors import InputError
from maipp.foresight.foresight import Foresight
from maipp.records import unknown
from maipp.scenario import Scenario

ForesightName = Literal["protocol", "fitted", "learned"]
FORESIGHTS: tuple[str, ...] = get_args(ForesightName)


def make_foresight(name: str, scenario: Scenario) -> Foresight:
    """The foresight of that name for a scenario. Raises `InputError` for an unknown name."""
    if name == "protocol":
        from maipp.foresight.protocol import ProtocolForesight

        return ProtocolForesight(scenario)
    if name == "fitted":
        from maipp.foresight.fitted import fitted_foresight

        return fitted_foresight(scenario)
    if name == "learned":
        from maipp.foresight.learned import learned_foresight

        return learned_foresight(scenario)
    raise InputError(unknown("foresight", name, list(FORESIGHTS)))
