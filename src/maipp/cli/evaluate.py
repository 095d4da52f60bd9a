"""`maipp evaluate`: planners on held-out missions, as tables and as JSON."""

import os
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import tyro

from maipp.bench.evaluate import Evaluation, check_counts, fingerprint_of
from maipp.bench.evaluation_jobs import EvaluationJob, evaluate_rows
from maipp.bench.evaluations import Comparison, compare, find, merged, read_evaluations, save_evaluations, to_json, what
from maipp.cli.evaluate_tables import budget_of, differences, means, stopped
from maipp.cli.notes import counting_bar, notes_console, results_console, tell_of
from maipp.cli.scenario_flags import FieldFlags
from maipp.cli.sweep_flags import SweepFlags
from maipp.errors import InputError
from maipp.fields.raster import Raster
from maipp.files import write_atomic
from maipp.foresight import ForesightName
from maipp.planners import make_planner, planner_names, planner_options
from maipp.planners.options import values_of
from maipp.problem import shape_of
from maipp.scenario import Scenario
from maipp.seeds import check_seed

INTERRUPTED = 130

_Row = tuple[str, Scenario, dict[str, str]]


@dataclass(frozen=True)
class EvaluateFlags(FieldFlags):
    """Score planners on held-out missions; all planners and budgets meet the same worlds.

    With --field that is the file's field, read as `maipp plan` reads it, and missions differ in their starts.
    """

    planners: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="[PLANNER ...]")] = ()
    """names (`maipp planners` lists them), or path/to/file.py:ClassName for one of your own"""

    budget: Annotated[tuple[float, ...], tyro.conf.arg(metavar="LENGTH [LENGTH ...]", help_behavior_hint="")] = ()
    """length of path each agent may travel, domain units; several are evaluated one by one"""

    planner: Annotated[tuple[str, ...], tyro.conf.arg(metavar="PLANNER [PLANNER ...]", help_behavior_hint="")] = ()
    """the same as PLANNER without the flag"""

    reference: Annotated[str | None, tyro.conf.arg(metavar="PLANNER", help_behavior_hint="")] = None
    """compare the others with this one in pairs: differences in every metric, with errors, intervals and tests"""

    instances: Annotated[str, tyro.conf.arg(metavar="COUNT|FIRST:END")] = "30"
    """worlds (ground truth and start): so many, or those from number FIRST up to END, which is left out"""

    trials: int = 10
    """runs per world, each with fresh roadmaps and fresh randomness"""

    seed: int = 0
    """seed of the worlds"""

    timing: bool = True
    """measure the time of single decisions as well (costs one more compilation)"""

    map: Annotated[ForesightName | None, tyro.conf.arg(metavar="FORESIGHT", help_behavior_hint="")] = None
    """score the map of this foresight as well: its error, and how often its intervals and the belief's hold"""

    json: Annotated[str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """write everything, per-mission values included, to this file; - is standard output"""

    csv: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """write a line for each mission, with every metric, to this file"""

    resume: bool = False
    """leave out what the file of --json holds already"""

    shard: Annotated[str | None, tyro.conf.arg(metavar="I/N", help_behavior_hint="")] = None
    """evaluate the I-th of N parts of the instances only, to be put together by --merge"""

    sweep: tyro.conf.OmitArgPrefixes[SweepFlags] = field(default_factory=SweepFlags)

    merge: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE [FILE ...]", help_behavior_hint="")] = ()
    """evaluate nothing: put the parts that these files hold together"""


def run(flags: EvaluateFlags) -> int:
    """Evaluate row by row, so that an interrupt keeps the rows that are done; gives 130 then."""
    to_file = flags.json not in (None, "-")
    if to_file:
        _check_writable("--json", Path(str(flags.json)))
    if flags.csv is not None:
        _check_writable("--csv", flags.csv)
    done, kept, code, refused = _EvaluationRun(_merged(flags)) if flags.merge else _evaluated(flags, to_file)
    compared = _show(flags, done) if done else []
    if to_file and done:
        save_evaluations([*done, *kept], str(flags.json), compared)
        notes_console().print(f"wrote {flags.json}")
    if flags.csv is not None and done:
        from maipp.bench.frame import evaluated  # pandas, only where it is wanted
        from maipp.bench.tidy_csv import missions_csv

        write_atomic(flags.csv, missions_csv(evaluated(done)))
        notes_console().print(f"wrote {flags.csv}")
    for warning in filter(None, map(stopped, done)):
        notes_console().print(warning, markup=False)
    if refused is not None:
        raise refused
    return code


class _EvaluationRun(NamedTuple):
    done: list[Evaluation]
    kept: Sequence[Evaluation] = ()  # of the file before, and not come to yet
    code: int = 0
    refused: InputError | None = None  # what kept the other rows from being done


def _show(flags: EvaluateFlags, done: list[Evaluation]) -> list[dict[str, Any]]:
    """Print the tables, and the JSON where it goes to standard output; the comparisons."""
    # The tables make way where standard output is the JSON, and keep their width where they go to a file.
    out = results_console(stderr=flags.json == "-")
    out.print(means(done))
    compared: list[Comparison] = []
    if flags.reference is not None and {each.planner for each in done} > {flags.reference}:
        compared = compare(done, flags.reference)
        out.print(differences(compared, flags.reference))
    told = [each.to_dict() for each in compared]
    if flags.json == "-":
        sys.stdout.write(to_json(done, told))
    return told


def _evaluated(flags: EvaluateFlags, to_file: bool) -> _EvaluationRun:
    """Row by row, or in parts by the processes that the flags name."""
    check_seed(flags.seed, "--seed")
    check_counts("--", trials=flags.trials)
    first, instances = _instances(flags.instances, flags.shard)
    where = flags.sweep.where()
    raster = flags.read_field(flags.to_scenario(flags.budget[0] if flags.budget else None))
    rows = _rows(flags, raster)
    shape = shape_of([scenario for _, scenario, _ in rows])
    jobs = [
        EvaluationJob(
            planner,
            scenario,
            options,
            first,
            instances,
            flags.trials,
            flags.seed,
            flags.timing,
            shape,
            raster,
            flags.map,
        )
        for planner, scenario, options in rows
    ]
    known = _known(flags, to_file)
    done: dict[int, Evaluation] = {}
    for number, job in enumerate(jobs):
        found = _find(known, job)
        if found is not None:
            done[number] = found
            known = [other for other in known if other is not found]
    notes, refused = notes_console(), None

    def outcome(code: int = 0) -> _EvaluationRun:
        return _EvaluationRun([done[number] for number in sorted(done)], known, code, refused)

    def keep(number: int, evaluation: Evaluation) -> None:
        done[number] = evaluation
        if to_file:  # what is known and has not come yet is kept
            save_evaluations([*outcome().done, *known], str(flags.json))

    missing = [number for number in range(len(jobs)) if number not in done]
    try:
        with counting_bar(notes, "missions") as bar:
            each = instances * flags.trials
            task = bar.add_task("", total=len(missing) * each)
            if where.cluster is None and not where.workers:
                for before, number in enumerate(missing):
                    job = jobs[number]
                    bar.update(task, description=f"{job.planner}, budget {budget_of(job.scenario)}")
                    keep(
                        number,
                        job.compute(
                            lambda missions, _, before=before: bar.update(task, completed=before * each + missions)
                        ),
                    )
            else:
                evaluate_rows(
                    [jobs[number] for number in missing],
                    lambda number, evaluation: keep(missing[number], evaluation),
                    where=where,
                    progress=lambda missions: bar.update(task, completed=missions),
                    note=lambda line: notes.print(line, markup=False),
                )
    except KeyboardInterrupt:
        notes.print(f"interrupted: {len(done)} of {len(rows)} rows are done")
        return outcome(INTERRUPTED)
    except InputError as error:  # a row that cannot be scored must not take those that are done with it
        if not done:
            raise
        refused = error
    return outcome()


def _find(known: Sequence[Evaluation], job: EvaluationJob) -> Evaluation | None:
    """What the job comes to, if it is known."""
    if not known:
        return None
    made = make_planner(job.planner, job.scenario, job.options)
    wanted = what(job.planner, values_of(made), job.scenario, job.seed, job.trials)
    code = fingerprint_of(made, job.field)
    return find(known, wanted, job.first, job.instances, code, timing=job.timing, map=job.map)


def _merged(flags: EvaluateFlags) -> list[Evaluation]:
    """The evaluations that the files hold, parts put together."""
    if flags.planners or flags.planner or flags.shard or flags.resume or flags.sweep != SweepFlags():
        raise InputError("--merge: evaluates nothing; leave out the planners, --shard, --resume, --workers, --cluster")
    done = merged([each for path in flags.merge for each in read_evaluations(path)])
    if not done:
        raise InputError(f"--merge: {flags.merge[0]} holds no evaluations")
    return done


def _known(flags: EvaluateFlags, to_file: bool) -> list[Evaluation]:
    """What is not to be evaluated again."""
    if not flags.resume:
        return []
    if not to_file:
        raise InputError("--resume: goes on with the file of --json; give --json FILE")
    path = Path(str(flags.json))
    return read_evaluations(path) if path.exists() else []


def _instances(text: str, shard: str | None) -> tuple[int, int]:
    """The first instance and how many there are. Raises `InputError` for what says none."""
    match = re.fullmatch(r"(?:(\d{1,9}):)?(\d{1,9})", text)
    if match is None:
        raise InputError(
            f"--instances: {text!r:.40} is no number of instances; give a count, or FIRST:END such as 20:40"
        )
    first, end = int(match[1] or 0), int(match[2])
    if end <= first:
        raise InputError(f"--instances: {text} are none; give a count >= 1, or FIRST:END such as 20:40")
    if shard is None:
        return first, end - first
    match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", shard)
    part, parts = (int(match[1]), int(match[2])) if match else (0, 0)
    if not 1 <= part <= parts <= end - first:
        raise InputError(f"--shard: {shard!r:.40} is no part of {end - first} instances; give I/N such as 1/4")
    begin, stop = (first + (end - first) * k // parts for k in (part - 1, part))
    return begin, stop - begin


def _rows(flags: EvaluateFlags, field: Raster | None = None) -> list[_Row]:
    """Planner, scenario and options of every row. Raises `InputError` for what is wrong with any of them."""
    planners = dict.fromkeys([*flags.planners, *flags.planner])
    if not planners:
        raise InputError(f"no planner is given; give one or more of {', '.join(planner_names())}")
    if flags.reference is not None and flags.reference not in planners:
        raise InputError(f"--reference: {flags.reference} is none of the planners given, {', '.join(planners)}")
    names = {planner: {option.name for option in planner_options(planner)} for planner in planners}
    flags.check_weights(planners)
    tell_of(planners)
    given = flags.planner_options()
    rows = []
    for budget in flags.budget or (None,):
        scenario = flags.in_field(flags.to_scenario(budget), field)
        for planner, own in names.items():
            # An option goes to the planners that have it; one that nobody has is refused by the first.
            others = set().union(*names.values()) - own
            options = {key: value for key, value in given.items() if key not in others}
            make_planner(planner, scenario, options)  # before any work: a bad option in the last row costs nothing
            rows.append((planner, scenario, options))
    return rows


def _check_writable(flag: str, path: Path) -> None:
    """Raises `InputError` before hours of work rather than after them."""
    if path.is_dir():
        raise InputError(f"{flag}: {path} is a folder; give a file")
    if not path.parent.is_dir():
        raise InputError(f"{flag}: no folder {path.parent}; make it first")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{flag}: no permission to write in {path.parent}")
