"""`maipp survey`: from a mission file to routes that can be loaded, and what the team can expect of them."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro
from rich import box
from rich.console import Console
from rich.table import Table

from maipp.cli.notes import results_console
from maipp.cli.scenario_flags import foresight_named
from maipp.cli.sweep_flags import SweepFlags
from maipp.errors import InputError
from maipp.files import staged_folder, write_atomic
from maipp.records import assignments
from maipp.seeds import check_seed

if TYPE_CHECKING:  # they import JAX, which `maipp survey --help` can do without
    from maipp.engine.episode import Episode
    from maipp.route_files.route_plan import RoutePlan
    from maipp.surveys.expected_mission import ExpectedSurvey
    from maipp.surveys.mission_file import MissionFile as MissionFile
    from maipp.surveys.standardise import PreparedSurvey

_ONLY_SOMETIMES = ("kernel.png", "report.html")  # among the files of a planned survey


@dataclass(frozen=True)
class SurveyFlags:
    """Plan a survey of a real place from a mission file (docs/survey.md), or rehearse it.

    maipp survey --new mission.yaml: write a commented mission file to start from

    maipp survey mission.yaml --check: say what is wrong with it, or what will be planned

    maipp survey mission.yaml --out DIR: plan it, route files for the robots, report.html, overview.png

    maipp survey mission.yaml --rehearse: simulate it on possible fields, what can the team expect?
    """

    mission: Annotated[Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="MISSION.yaml")] = None
    """the mission file"""

    new: bool = False
    """write a commented mission file to MISSION.yaml, or to standard output without one"""

    check: bool = False
    """read and check only; write nothing"""

    out: Path = Path("out/survey")
    """folder to write to"""

    planner: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(default: the file's)")] = None
    """planner instead of the file's"""

    seed: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="(default: the file's)")] = None
    """seed instead of the file's"""

    settings: Annotated[
        tuple[tuple[str, ...], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(name="set", metavar="KEY=VALUE [KEY=VALUE ...]"),
    ] = ()
    """options of the planner (`maipp planners` lists them)"""

    rehearse: bool = False
    """simulate the mission on possible fields instead of planning it"""

    robots: Annotated[str | None, tyro.conf.arg(metavar="N..M", help_behavior_hint="(default: 1 to the file's)")] = None
    """sizes of the team to rehearse, such as 1..4 or 2; robots beyond the file's are copies of its last"""

    planners: Annotated[
        tuple[str, ...], tyro.conf.arg(metavar="NAME [NAME ...]", help_behavior_hint="(default: the file's)")
    ] = ()
    """planners to rehearse"""

    fields: Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="(default: the file's, or 30)")] = (
        None
    )
    """rehearsals of each planner and team"""

    raster: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: the file's)")] = None
    """gridded map to rehearse on instead of drawn fields, in the mission's coordinates and unit"""

    adapt: tyro.conf.FlagCreatePairsOff[bool] = False
    """rehearse each team once more with the kernel refitted under way, on fields of uncertain length scale"""

    foresight: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")] = None
    """rehearse: score the map that this foresight draws as well, such as fitted (docs/foresight.md)"""

    sweep: tyro.conf.OmitArgPrefixes[SweepFlags] = field(default_factory=SweepFlags)


def run(flags: SurveyFlags) -> int:
    """Write a template, check, plan or rehearse; raises `InputError` for what is wrong with the mission."""
    if flags.new:
        return _new(flags.mission)
    if flags.mission is None:
        raise InputError("no mission file; give one, or write one to start from: maipp survey --new mission.yaml")
    if flags.seed is not None:
        check_seed(flags.seed, "--seed")
    _check_flags(flags)
    from maipp.surveys.survey_io import load_survey

    survey = load_survey(flags.mission)
    return _rehearse(flags, survey) if flags.rehearse else _plan(flags, survey)


def _new(path: Path | None) -> int:
    from maipp.surveys.template import TEMPLATE

    if path is None:
        sys.stdout.write(TEMPLATE)
        return 0
    if path.exists():
        raise InputError(f"{path}: exists already; give another name")
    write_atomic(path, TEMPLATE)
    print(f"wrote {path}; change it, then: maipp survey {path} --check")
    return 0


def _check_flags(flags: SurveyFlags) -> None:
    """Raise `InputError` for flags of a rehearsal where there is none, and the other way round."""
    rehearsals = {"robots": flags.robots, "planners": flags.planners, "fields": flags.fields, "raster": flags.raster}
    rehearsals |= {"adapt": flags.adapt or None, "foresight": flags.foresight}
    rehearsals |= {"workers": flags.sweep.workers, "cluster": flags.sweep.cluster}
    if not flags.rehearse:
        for name, value in rehearsals.items():
            if value not in (None, ()):
                raise InputError(f"--{name}: says what to rehearse; add --rehearse, or leave it out")
    elif flags.planner is not None:
        raise InputError("--planner: a rehearsal may have several planners; give --planners")


def _plan(flags: SurveyFlags, survey: "MissionFile") -> int:
    from maipp.surveys.routes import check_files
    from maipp.surveys.standardise import prepare

    console = results_console()
    prepared = prepare(survey, planner=flags.planner, planner_options=assignments(flags.settings))
    prepared.make_planner()  # before any work
    check_files(prepared)
    _describe(prepared, console)
    if flags.check:
        console.print(f"{flags.mission}: a valid mission")
        return 0
    from maipp.route_files import fence_for
    from maipp.surveys.expected_mission import expected_course
    from maipp.surveys.routes import route_plan

    with Console(stderr=True).status("planning"), staged_folder(flags.out, gone=_ONLY_SOMETIMES) as stage:
        expected = expected_course(prepared, seed=flags.seed)
        plan = route_plan(prepared, expected.episode)
        written = _write_files(prepared, expected, plan, stage)
    console.print(_robots_table(prepared, expected.episode))
    if prepared.frame.geographic and (note := fence_for(plan, prepared.survey.vehicle).note) is not None:
        console.print(f"warning: {note}", markup=False)
    for name in written:
        console.print(f"wrote {flags.out / name}", markup=False)
    return 0


def _write_files(prepared: "PreparedSurvey", expected: "ExpectedSurvey", plan: "RoutePlan", folder: Path) -> list[str]:
    """Everything that a planned survey leaves, in the folder; the names of the files."""
    from maipp.engine.episode_io import write_episode
    from maipp.route_files import write_route_files
    from maipp.surveys.picture import draw_plan
    from maipp.viz.style import save_figure

    paths = write_route_files(plan, folder, vehicle=prepared.survey.vehicle)
    write_episode(expected.episode, folder / "episode.json")
    save_figure(draw_plan(prepared, expected.episode), folder / "overview.png")
    names = [*(path.name for path in paths), "episode.json", "overview.png"]
    if prepared.fit is not None:
        from maipp.viz.kernel_fit import draw_kernel_fit

        metres = prepared.prior_x * prepared.frame.scale
        values = prepared.frame.to_user_values(prepared.prior_y)
        unit = prepared.survey.unit or ""
        figure = draw_kernel_fit(prepared.fit, metres, values, length_unit="m", unit=unit)
        save_figure(figure, folder / "kernel.png")
        names.append("kernel.png")
    if find_spec("plotly") is None:
        print("left out report.html: it needs plotly; install it with: pip install 'maipp[geo]'", file=sys.stderr)
        return names
    from maipp.surveys.report import survey_report
    from maipp.viz.report import write_report

    write_report(folder / "report.html", survey_report(prepared, expected))
    return [*names, "report.html"]


def _describe(prepared: "PreparedSurvey", console: Console) -> None:
    """Print what is planned in the user's terms, and the warnings."""
    survey, frame, scenario = prepared.survey, prepared.frame, prepared.scenario
    width, height = frame.size
    unit = f" {survey.unit}" if survey.unit else ""
    scale = scenario.length_scale * frame.scale
    fitted = f", fitted to {prepared.fit.samples} samples" if prepared.fit is not None else ""
    noise = float(frame.to_user_std(scenario.noise**0.5))
    table = Table(box=box.SIMPLE_HEAD, show_header=False, padding=(0, 2, 0, 0))
    table.add_row("survey", f"{survey.name}, {len(prepared.names)} robots, {prepared.planner}")
    free, reached = _square(prepared.free_area), _square(prepared.region.area)
    table.add_row("area", f"{free} of {_length(width)} x {_length(height)}; routes keep to {reached} of it")
    table.add_row("prior", f"mean {frame.mean:.4g}, std {frame.std:.4g}{unit}, length scale {_length(scale)}{fitted}")
    table.add_row("noise", f"std {noise:.3g}{unit} of a measurement")
    if survey.threshold is not None:
        table.add_row("of interest", f"{'below' if survey.below else 'above'} {survey.threshold:g}{unit}")
    console.print(table)
    console.print(_team_table(prepared))
    for warning in prepared.warnings:
        console.print(f"warning: {warning}", markup=False)


def _team_table(prepared: "PreparedSurvey") -> Table:
    """What each robot may spend, what of it is kept back, and how far it is home."""
    from maipp.surveys.homes import distances_home

    frame, scenario = prepared.frame, prepared.scenario
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("robot")
    for heading in ("start", "speed m/s", "budget m", "minutes", "reserve m", "home", "way home m"):
        table.add_column(heading, justify="right")
    rows = zip(prepared.survey.robots, scenario.starts or (), distances_home(scenario), strict=True)
    for robot, start, (home, way) in rows:
        minutes = robot.budget_m / robot.speed / 60.0
        told = "anywhere" if home is None else "its start" if home == start else _place(prepared, home)
        length = "-" if way is None else f"{way * frame.scale:.0f}"
        numbers = f"{robot.speed:g}", f"{robot.budget_m:.0f}", f"{minutes:.1f}", f"{robot.reserve_m:.0f}"
        table.add_row(robot.name, _place(prepared, start), *numbers, told, length)
    return table


def _place(prepared: "PreparedSurvey", point: Sequence[float]) -> str:
    """A domain position in the user's coordinates."""
    x, y = prepared.frame.to_user(np.array(point)).tolist()
    return f"{x:.5f}, {y:.5f}" if prepared.frame.geographic else f"{x:.1f}, {y:.1f}"


def _robots_table(prepared: "PreparedSurvey", episode: "Episode") -> Table:
    """What each robot travels, how long, how often it measures, and where it ends."""
    from maipp.surveys.routes import minutes

    frame = prepared.frame
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("robot")
    for heading in ("length m", "of budget", "minutes", "measurements"):
        table.add_column(heading, justify="right")
    table.add_column("ends at")
    for name, agent in zip(prepared.names, episode.agents, strict=True):
        end = _place(prepared, agent.route[-1].tolist())
        length = agent.distance * frame.scale
        share = f"{agent.distance / agent.budget:.0%}"
        count = str(len(agent.measurement_y))
        table.add_row(name, f"{length:.0f}", share, f"{minutes(prepared, agent):.1f}", count, end)
    return table


def _square(area: float) -> str:
    return f"{area:.0f} m2" if area < 1e6 else f"{area / 1e6:.4g} km2"


def _length(metres: float) -> str:
    return f"{metres:.4g} m" if metres < 10_000 else f"{metres / 1000:.4g} km"


def _rehearse(flags: SurveyFlags, survey: "MissionFile") -> int:
    import dataclasses

    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from maipp.bench.sweep.dealing import HERE
    from maipp.surveys.rehearsal import rehearse
    from maipp.surveys.rehearsal_report import summary_table, words
    from maipp.surveys.rehearsal_report import write_report as write_rehearsal

    refitted = None
    if flags.adapt:
        from maipp.live.rehearse import refitted
    rehearsal = survey.rehearsal
    if flags.fields is not None:
        if not 1 <= flags.fields <= 10_000:
            raise InputError(f"--fields: {flags.fields} is not a number of fields from 1 to 10000")
        rehearsal = dataclasses.replace(rehearsal, fields=flags.fields)
    if flags.raster is not None:
        rehearsal = dataclasses.replace(rehearsal, raster=flags.raster, value=None, crs=None, at=None)
    notes = Console(stderr=True)
    where = flags.sweep.where()
    if where.cluster is None and where.workers is None:
        where = HERE
    foresight = foresight_named(flags.foresight)
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with staged_folder(flags.out) as stage:
        with Progress(*columns, console=notes, disable=not notes.is_terminal, transient=True) as bar:
            task = bar.add_task("")
            result = rehearse(
                survey,
                planners=flags.planners,
                robots=_sizes(flags.robots),
                rehearsal=rehearsal,
                seed=flags.seed,
                progress=lambda what, done, total: bar.update(task, description=what, completed=done, total=total),
                refitted=refitted,
                foresight=foresight,
                where=where,
                note=lambda line: notes.print(line, markup=False),
            )
        names = write_rehearsal(result, stage)
    console = results_console()
    for warning in result.warnings:
        console.print(f"warning: {warning}", markup=False)
    console.print(summary_table(result))
    for sentence in words(result):
        console.print(sentence, markup=False)
    for name in names:
        console.print(f"wrote {flags.out / name}", markup=False)
    return 0


def _sizes(text: str | None) -> tuple[int, ...]:
    """The sizes of teams that `1..4`, `2` or `1,3` spells; empty where nothing is given."""
    if text is None:
        return ()
    first, dots, last = text.partition("..")
    try:
        sizes = tuple(range(int(first), int(last) + 1)) if dots else tuple(int(each) for each in text.split(","))
    except ValueError:
        sizes = ()
    if not sizes or min(sizes) < 1 or max(sizes) > 100:
        raise InputError(f"--robots: {text!r} is no size of a team; give 1..4, 2 or 1,3 (100 at most)")
    return sizes
