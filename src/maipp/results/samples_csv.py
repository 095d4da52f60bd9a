"""All samples of a survey as CSV: one row each, those that do not count marked."""

import csv
import io

from maipp.results.taken import Taken


def samples_csv(taken: Taken) -> str:
    """id, robot, time, the two coordinates, value, surprise, counts (yes or no), and why not (empty where it does).

    Live the numbers are as they were reported; times are seconds. Of a record times are in the scenario's unit.
    """
    frame, text = taken.frame, io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    x, y = ("longitude", "latitude") if frame.geographic else ("x", "y")
    unit = f"value ({frame.unit})" if frame.unit else "value"
    writer.writerow(["id", "robot", "time_s" if taken.live else "time", x, y, unit, "surprise", "counts", "why_not"])
    for each in taken.samples:
        surprise = "" if each.surprise is None else f"{each.surprise:.2f}"
        numbers = [_plain(number) for number in (each.time, each.x, each.y, each.value)]
        writer.writerow(
            [_text(each.id), _text(each.robot), *numbers, surprise, "no" if each.out else "yes", each.out or ""]
        )
    return text.getvalue()


def _plain(number: float) -> str:
    """Thirteen digits: Unix times to the millisecond, places to 0.1 mm."""
    return f"{number:.13g}"


def _text(text: str) -> str:
    """A text that spreadsheets do not take for a formula, on one line."""
    line = " ".join(text.split())
    return f"'{line}" if line.startswith(("=", "+", "-", "@")) else line
