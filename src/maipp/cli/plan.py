"""`maipp plan`: one survey, planned and simulated, with its record, tables and pictures."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import date
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Annotated

import tyro
from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from maipp.cli.notes import tell_of
from maipp.cli.scenario_flags import FieldFlags, foresight_named
from maipp.cli.stopped import stopped_warning
from maipp.errors import InputError
from maipp.files import staged_folder, write_atomic
from maipp.scenario import Scenario
from maipp.seeds import check_seed

if TYPE_CHECKING:  # they import JAX, which `maipp plan --help` can do without
    from maipp.engine.episode import Episode
    from maipp.fields.raster import Raster
    from maipp.foresight import ForesightName
    from maipp.team.broadcast import Broadcast

_REPORT = "report.html"
_ONLY_SOMETIMES = ("mission.mp4", "mission.gif", _REPORT)
_STEPS = ("drawing the mission", "planning", "scoring", "drawing the overview", "drawing the animation")


@dataclass(frozen=True)
class PlanFlags(FieldFlags):
    """Plan one survey and write its record, tables, pictures and interactive report.

    The files are episode.json, waypoints.csv, measurements.csv, overview.png, mission.mp4 or .gif, and, where plotly is
    installed, report.html.

    With --field, the longest side of the file becomes 1 domain unit, and its values are scaled to 0..1; everything
    that is written, but for episode.json, is in the file's own coordinates and units.
    """

    planner: str = "receding-horizon"
    """name (`maipp planners` lists them), or path/to/file.py:ClassName for one of your own"""

    seed: int = 0
    """seed of the world and of the planner's randomness"""

    out: Path = Path("out/plan")
    """folder to write to"""

    foresight: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")] = None
    """add the map that this foresight draws to the report, such as fitted (docs/foresight.md)"""

    animation: bool = True
    """draw the animation, which takes a few seconds"""


def run(flags: PlanFlags) -> int:
    """Plan the survey that the flags describe, write its files, print its numbers."""
    scenario = flags.to_scenario()
    field = flags.read_field(scenario)
    scenario = flags.in_field(scenario, field)
    check_seed(flags.seed, "--seed")
    flags.check_weights([flags.planner])
    foresight = foresight_named(flags.foresight)
    if foresight is not None and not _has_plotly():
        raise InputError(f"--foresight: its map is drawn in {_REPORT}, which needs plotly: pip install 'maipp[geo]'")
    episode, paths = survey(
        scenario,
        flags.planner,
        flags.planner_options(),
        seed=flags.seed,
        out=flags.out,
        field=field,
        animation=flags.animation,
        foresight=foresight,
    )
    report(episode, paths)
    return 0


def survey(
    scenario: Scenario,
    planner: str,
    options: Mapping[str, object],
    *,
    seed: int,
    out: Path,
    field: "Raster | None" = None,
    animation: bool = True,
    foresight: "ForesightName | None" = None,
) -> "tuple[Episode, list[Path]]":
    """Run one survey and write its files to `out`, all of them or none; returns the record and the files' paths.

    Progress is shown on standard error where that is a terminal. Raises `InputError` for planners, options,
    obstacles and folders that cannot be used.
    """
    from maipp.planners import make_planner

    built = make_planner(planner, scenario, options)  # before any work
    Thread(target=_import_drawing, daemon=True).start()  # JAX loads, compiles and computes without Python meanwhile
    tell_of([planner])
    console = Console(stderr=True)
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with (
        staged_folder(out, gone=_ONLY_SOMETIMES) as stage,
        Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar,
    ):
        task = bar.add_task(_STEPS[0], total=len(_STEPS))
        steps = iter(_STEPS[1:])

        def advance() -> None:
            bar.update(task, advance=1, description=next(steps, ""))

        def drawn(frames: int, total: int) -> None:
            bar.update(task, completed=len(_STEPS) - 1 + frames / total)

        episode, told = _simulate(scenario, planner, built, options, seed, field, advance)
        _write_files(episode, told, foresight, stage, advance, drawn if animation else None)
        names = sorted(path.name for path in stage.iterdir())
    return episode, [out / name for name in names]


def report(episode: "Episode", paths: list[Path]) -> None:
    """Print the survey's numbers and the paths of its files to standard output."""
    metrics, there, scenario = episode.metrics, episode.geo, episode.scenario
    scale, unit = there.metres_per_unit, " m"
    if scale is None:
        scale, unit = (there.length_scale, "") if episode.reference else (None, "")
    elif max(agent.distance for agent in episode.agents) * scale >= 10_000:
        scale, unit = scale / 1000, " km"
    lengths = [agent.distance * (scale or 1.0) for agent in episode.agents]
    distances = ", ".join(f"{length:.4g}" for length in lengths)
    if len(lengths) > 4:
        distances = f"{sum(lengths):.4g} in all, {min(lengths):.4g} to {max(lengths):.4g} each,"
    length = unit if scale else " domain units"
    unspent = f"{episode.unspent * (scale or 1.0):.4g}{length}, mean over the agents"
    table = Table(box=box.SIMPLE_HEAD, show_header=False, padding=(0, 2, 0, 0))
    table.add_column()
    table.add_column(justify="left")
    count = sum(len(agent.measurement_y) for agent in episode.agents)
    for name, value in (
        ("planner", f"{episode.planner}, {scenario.agents} agents, seed {episode.seed}"),
        ("Tr(P)", f"{metrics.trace:.4g} (before: {metrics.curve_trace[0]:.4g})"),
        ("Tr(P), own beliefs", f"{metrics.own_trace.mean():.4g}"),
        ("Tr(P), true area", f"{metrics.true_trace:.4g}"),
        (
            "RMSE",
            f"{float(there.to_user_std(metrics.rmse)):.4g}" + (f" ({there.value_name})" if episode.reference else ""),
        ),
        ("mutual information", f"{metrics.mutual_information:.4g} nats"),
        ("distance travelled", distances + length),
        ("budget unspent", unspent),
        ("measurements", f"{count}, after {episode.decisions} decisions of {episode.message_bytes} bytes sent each"),
    ):
        table.add_row(name, value)
    if episode.prior is not None:
        table.add_row("prior samples", f"{len(episode.prior.y)}")
    console = Console(highlight=False, soft_wrap=True)
    console.print(table)
    for path in paths:
        console.print(f"wrote {path}", markup=False)
    reasons = [agent.stopped_by for agent in episode.agents]
    warning = stopped_warning(
        episode.planner,
        agents=len(reasons),
        not_finite=reasons.count("not-finite"),
        record_full=reasons.count("record-full"),
        unspent=unspent,
    )
    if warning is not None:
        Console(stderr=True, highlight=False, soft_wrap=True).print(warning, markup=False)
    if all(path.name != _REPORT for path in paths):
        console.print(f"left out {_REPORT}: it needs plotly, pip install 'maipp[geo]'", markup=False)


def _import_drawing() -> None:
    """Import what draws; what cannot be imported is told of where it is needed."""
    with suppress(Exception):
        import_module("maipp.viz")
        if _has_plotly():
            import_module("maipp.viz.report")


def _has_plotly() -> bool:
    return find_spec("plotly") is not None


def _simulate(
    scenario, name, planner, options, seed, field, advance: Callable[[], None]
) -> "tuple[Episode, tuple[Broadcast, ...]]":
    """The record, and for the report what the robots told each other where that says where they are going."""
    import jax

    from maipp.engine import draw_missions, run_missions
    from maipp.engine.episode import Episode
    from maipp.engine.keys import key_of
    from maipp.engine.rollout import run_recorded
    from maipp.planners.announced.recorded_messages import broadcasts_of, tells_plans, whole_message

    try:
        missions = draw_missions(
            scenario,
            seed=seed,
            instances=1,
            planner=planner,
            field=field,
        )
    except ValueError as error:  # obstacles or a start that leave no way to go
        raise InputError(str(error)) from error
    advance()
    told, key = (), key_of(seed)
    if tells_plans(planner):
        states, events = run_recorded(planner, missions, key, whole_message)
        told = broadcasts_of(events)
    else:
        states = jax.block_until_ready(run_missions(planner, missions, key))
    advance()
    there = None if field is None else field.reference
    episode = Episode.from_state(scenario, name, options, seed, missions, states, reference=there)
    _ = episode.metrics  # computed here, under its own step
    advance()
    return episode, told


def _write_files(
    episode: "Episode",
    told: "tuple[Broadcast, ...]",
    foresight: "ForesightName | None",
    folder: Path,
    advance: Callable[[], None],
    drawn: Callable[[int, int], None] | None,
) -> None:
    from maipp.engine.episode_io import measurements_csv, waypoints_csv, write_episode
    from maipp.viz import save_animation, save_overview

    write_episode(episode, folder / "episode.json")
    write_atomic(folder / "waypoints.csv", waypoints_csv(episode))
    write_atomic(folder / "measurements.csv", measurements_csv(episode))
    save_overview(episode, folder / "overview.png")
    if _has_plotly():
        from maipp.viz.captions import headline
        from maipp.viz.report import SurveyReport, write_report

        seen = None
        if foresight is not None:
            from maipp.results.foreseen import foreseen
            from maipp.results.records import belief_of

            seen = foreseen(episode, belief_of(episode), foresight)
        today = date.today().isoformat()
        facts = SurveyReport(episode, title=headline(episode), date=today, broadcasts=told, foreseen=seen)
        write_report(folder / _REPORT, facts)
    advance()
    if drawn is not None:
        save_animation(episode, folder / "mission", drawn)
