"""The units in which a report gives lengths and times, and how it writes numbers."""

import math
from dataclasses import dataclass

from maipp.viz.report_survey import SurveyReport


@dataclass(frozen=True)
class Unit:
    """A unit for showing: shown number = number in the record * factor."""

    factor: float
    name: str  # "m"; empty where the record's own unit has no name

    def text(self, value: float, digits: int = 3) -> str:
        """A result of the survey in this unit."""
        return f"{number(value * self.factor, digits)} {self.name}".rstrip()

    def setting(self, value: float) -> str:
        """A setting in this unit: digits that say nothing are left out."""
        return f"{setting(value * self.factor)} {self.name}".rstrip()


def length_unit(report: SurveyReport) -> Unit:
    """For lengths: metres or kilometres, else the unit of the file's coordinates, else domain units."""
    there = report.geo
    if there.metres_per_unit is not None:
        longest = max(agent.budget for agent in report.episode.agents) * there.metres_per_unit
        return Unit(there.metres_per_unit / 1000, "km") if longest >= 10_000 else Unit(there.metres_per_unit, "m")
    known = report.reference or report.episode.reference
    if known is None or known.length_scale is None:
        return Unit(1.0, "domain units")
    return Unit(known.length_scale, "map units")


def time_unit(report: SurveyReport) -> Unit:
    """For times: seconds, minutes or hours, as the survey is long; else the scenario's own unit, which has no name."""
    if report.seconds_per_time is None:
        return Unit(1.0, "")
    seconds = report.episode.end * report.seconds_per_time
    size, name = (1, "s") if seconds < 120 else (60, "min") if seconds < 6 * 3600 else (3600, "h")
    return Unit(report.seconds_per_time / size, name)


def number(value: float, digits: int = 3) -> str:
    """A number with this many significant digits, whole digits always all of them and no exponent for common sizes."""
    if not math.isfinite(value):
        return "unknown"
    if value == 0:
        return "0"
    magnitude = math.floor(math.log10(abs(value)))
    if magnitude < -5 or magnitude > 8:
        return f"{value:.{digits - 1}e}"
    return f"{value:,.{max(0, digits - 1 - magnitude)}f}".replace(",", "\u202f")  # a narrow space that does not break


def setting(value: float) -> str:
    """A number that a person chose: four significant digits, but no zeros at the end."""
    text = number(value, 4)
    return text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text


def percent(part: float, whole: float) -> str:
    """A share in per cent; an empty whole has none."""
    if not whole > 0:
        return "none"
    share = 100 * part / whole
    return f"{share:.0f} %" if share >= 9.95 or share == 0 else f"{share:.2g} %"


def decimals(extent: float, digits: int) -> int:
    """Decimals with which a coordinate tells this many digits of an area that is `extent` across."""
    return min(max(digits - 1 - math.floor(math.log10(extent)), 0), 9) if extent > 0 else digits


def nice_step(span: float, steps: int) -> float:
    """The smallest of 1, 2, 2.5, 5 times a power of ten that divides `span` into at most `steps` parts."""
    smallest = span / steps
    power = 10.0 ** math.floor(math.log10(smallest))
    return next(nice * power for nice in (1.0, 2.0, 2.5, 5.0, 10.0) if nice * power >= smallest * (1 - 1e-9))
