"""`maipp COMMAND ...`: finds the command, prepares JAX if it computes, turns errors into one line and an exit code.

Nothing heavy is imported before a command is known, so that `maipp --help` answers at once.
"""

import atexit
import gc
import importlib
import os
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import NamedTuple

from maipp.errors import InputError

INPUT_ERROR, INTERRUPTED, BROKEN_PIPE = 2, 130, 141


class Command(NamedTuple):
    """One command: the module `maipp.cli.<name>` has its flags as a dataclass and `run(flags) -> exit code`.

    A name of two words is that of the module `maipp.cli.<one>_<other>`.
    """

    flags: str  # name of the dataclass
    computes: bool  # whether it uses JAX
    summary: str


COMMANDS = {
    "plan": Command("PlanFlags", True, "plan one survey, and write its record and figures"),
    "evaluate": Command("EvaluateFlags", True, "score planners on held-out missions"),
    "benchmark": Command("BenchmarkFlags", True, "regenerate the paper's tables and figures, and measure speed"),
    "worker": Command("WorkerFlags", False, "work for a cluster with the cores of this machine"),
    "scheduler": Command("SchedulerFlags", False, "be the scheduler of a cluster"),
    "train": Command("TrainFlags", True, "train a policy, with checkpoints, a log and a learning curve"),
    "train foresight": Command("TrainForesightFlags", True, "train the network that foresees the field"),
    "live": Command("LiveFlags", True, "answer robots under way: reports in, waypoints out, one JSON line each"),
    "result": Command(
        "ResultFlags", True, "write what a survey took home, from its journal or record: map, samples, report"
    ),
    "robot": Command("RobotFlags", True, "run one robot of a fleet: its belief, log, decisions and vehicle"),
    "fleet": Command("FleetFlags", True, "watch a fleet of robots on a page, or simulate one"),
    "fleet keys": Command(
        "FleetKeysFlags", False, "make the certificates by which the robots of a fleet know each other"
    ),
    "planners": Command("PlannersFlags", True, "list the planners and their options"),
    "survey": Command("SurveyFlags", True, "plan a survey of a real place from a mission file, or rehearse it"),
    "demo": Command("DemoFlags", True, "survey real bathymetry with three robots, and draw what they found"),
    "scenario": Command("PrintScenario", False, "print the default scenario, or check a file"),
}


def usage() -> str:
    """What `maipp --help` prints."""
    width = max(map(len, COMMANDS))
    rows = "\n".join(f"  {name:<{width}}  {command.summary}" for name, command in COMMANDS.items())
    return (
        "usage: maipp COMMAND [OPTIONS]\n\n"
        "Multi-agent adaptive informative path planning.\n\n"
        f"commands:\n{rows}\n\n"
        "  maipp COMMAND --help  options of a command\n"
        "  maipp --version       version\n\n"
        "environment:\n"
        "  MAIPP_CACHE           folder for compiled programs; empty: keep none\n"
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; gives its exit code: 0, 2 for bad input, 130 when interrupted."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        code = _dispatch(arguments)
        sys.stdout.flush()
        return code
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return INPUT_ERROR
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader (head, less) has seen enough; do not complain at exit either
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except SystemExit as stop:  # a flag that does not parse, or --help of a command
        return stop.code if isinstance(stop.code, int) else int(stop.code is not None)


def _dispatch(arguments: list[str]) -> int:
    name, rest = command_of(arguments)
    if name in ("-h", "--help", "help"):
        print(usage(), end="")
        return 0
    if name in ("-V", "--version"):
        import maipp

        print(f"maipp {maipp.__version__}")
        return 0
    if name not in COMMANDS:
        raise InputError(_unknown_command(name))
    command = COMMANDS[name]
    if command.computes and not {"-h", "--help"} & set(rest):
        prepare_jax()
    import tyro

    module = module_of(name)
    rest = module.arguments(rest) if hasattr(module, "arguments") else rest
    return module.run(tyro.cli(flags_of(name), prog=f"maipp {name}", args=rest))


def command_of(arguments: Sequence[str]) -> tuple[str, list[str]]:
    """The name of the command, of one word or two, and what follows it."""
    words = 2 if " ".join(arguments[:2]) in COMMANDS else 1
    return " ".join(arguments[:words]) or "--help", [*arguments[words:]]


def module_of(name: str) -> ModuleType:
    """The module of a command."""
    return importlib.import_module(f"maipp.cli.{name.replace(' ', '_')}")


def flags_of(name: str) -> type:
    """The dataclass of a command's flags."""
    return getattr(module_of(name), COMMANDS[name].flags)


def _unknown_command(name: str) -> str:
    import difflib

    near = difflib.get_close_matches(name.lower(), COMMANDS, n=1)
    meant = f" (did you mean {near[0]}?)" if near else ""
    return f"no command {name!r}{meant}; there are {', '.join(COMMANDS)}"


def prepare_jax() -> None:
    """Make JAX use every core and keep compiled programs between runs; must run before JAX is used."""
    from maipp.devices import keep_compiled, use_all_cores

    keep_compiled()
    use_all_cores()
    # Tracing makes many objects that live on: looking through them for garbage as often as by default is an eighth of
    # what `maipp plan` takes.
    gc.set_threshold(100_000, 20, 50)
    atexit.register(gc.freeze)  # on the way out, what is left is not looked through once more: half a second


if __name__ == "__main__":
    sys.exit(main())
