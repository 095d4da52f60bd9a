"""What commands say beside their results: lines and bars on standard error."""

from collections.abc import Iterable

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from maipp.planners import planner_note

_PIPE = 1000  # columns


def results_console(stderr: bool = False) -> Console:
    """Standard output as it is; tables that go into a pipe or file are as wide as they need."""
    console = Console(stderr=stderr, highlight=False, soft_wrap=True)
    if not console.is_terminal:
        console.width = _PIPE
    return console


def notes_console() -> Console:
    """Standard error as it is: nothing highlighted, long lines left to the terminal."""
    return Console(stderr=True, highlight=False, soft_wrap=True)


def tell_of(planners: Iterable[str]) -> None:
    """Say what is to be known of these planners' names, if anything."""
    for note in dict.fromkeys(map(planner_note, planners)):
        if note:
            notes_console().print(f"note: {note}", markup=False)


def counting_bar(notes: Console, unit: str) -> Progress:
    """A bar with what is worked on, how many units are done, and the time; nothing where there is no terminal."""
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn(unit), TimeElapsedColumn()
    return Progress(*columns, console=notes, disable=not notes.is_terminal)
