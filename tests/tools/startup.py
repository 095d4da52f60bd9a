"""`python -m tests.tools.startup`: how long `maipp plan` and `maipp live` take until there is an answer.

Each is run with an empty cache folder (cold), then again with the same one (warm). With `--also SRC`, those of another
source tree in turns with those here, since a machine is quicker at one time than at another. Where the time goes is
told of one more warm run of `maipp plan`, and of the programs that it had to compile.
"""

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import tyro

_HERE = Path(__file__).parents[2]
_MISSION = _HERE / "docs" / "examples" / "strait" / "mission.yaml"


@dataclass(frozen=True)
class Startup:
    """Time the first answer, cold and warm."""

    also: Path | None = None
    """src folder of another tree"""
    repeat: int = 3
    """warm runs of each; the best one counts"""


class Cost(NamedTuple):
    """What a run cost until its answer; of `maipp live` the CPU time is that until its end."""

    wall: float  # seconds
    cpu: float  # seconds, of all its threads
    memory: float  # MiB, the most


def cost(command: str, source: Path, cache: Path) -> Cost:
    """One run of `plan` or `live`."""
    environment = os.environ | {"PYTHONPATH": str(source), "MAIPP_CACHE": str(cache)}
    with tempfile.TemporaryDirectory() as out:
        arguments = ["--out", f"{out}/plan"] if command == "plan" else [str(_MISSION), "--journal", f"{out}/journal"]
        begun = time.perf_counter()
        with subprocess.Popen(
            [sys.executable, "-m", "maipp", command, *arguments],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        ) as process:
            assert process.stdin is not None and process.stdout is not None
            if command == "live":
                process.stdout.readline()
                wall = time.perf_counter() - begun
            process.stdin.close()
            process.stdout.read()
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            if command == "plan":
                wall = time.perf_counter() - begun
    if process.returncode:
        raise SystemExit(f"maipp {command} of {source} ended with {process.returncode}")
    return Cost(wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


# Runs the command line in a process that notes what JAX tells it, and what the functions named cost.
_PROFILE = """
import sys, time, collections, importlib
begun, spent = time.process_time(), collections.Counter()
from maipp.cli import main
main.prepare_jax()
import jax
import maipp.cli.plan, maipp.engine.rollout, maipp.viz, maipp.viz.report, maipp.planners
spent["imports"] = time.process_time() - begun
compiled, kinds = [], {"jaxpr_trace_duration": "tracing", "jaxpr_to_mlir_module_duration": "lowering",
    "backend_compile_duration": "compiling, or loading from JAX's cache"}
def note(event, seconds, **told):
    kind = kinds.get(event.rsplit("/", 1)[-1])
    if kind:
        spent[kind] += seconds
        if kind.startswith("compiling"):
            compiled.append(f"{told.get('fun_name')} {seconds:.2f}")
jax.monitoring.register_event_duration_secs_listener(note)
def timed(module, name, what):
    module = importlib.import_module(module)
    function = getattr(module, name)
    def run(*args, **kwargs):
        start, before = time.process_time(), sum(spent.values())
        try:
            return function(*args, **kwargs)
        finally:
            spent[what] += time.process_time() - start - (sum(spent.values()) - before)
    setattr(module, name, run)
timed("maipp.viz", "save_overview", "drawing the figure")
timed("maipp.viz", "save_animation", "drawing the film")
timed("maipp.viz.report", "write_report", "writing the report")
try:
    timed("maipp.kept.program", "_read", "loading kept programs")
except ModuleNotFoundError:
    pass
code = main.main(["plan", "--out", sys.argv[1]])
spent["running, and the rest"] = time.process_time() - begun - sum(spent.values())
for what, seconds in spent.most_common():
    print(f"  {seconds:6.2f}  {what}", file=sys.stderr)
print("  compiled:", ", ".join(compiled) or "nothing", file=sys.stderr)
sys.exit(code)
"""


def profile(source: Path, cache: Path) -> str:
    """Where the CPU time of one run of `maipp plan` goes, in lines."""
    environment = os.environ | {"PYTHONPATH": str(source), "MAIPP_CACHE": str(cache)}
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-c", _PROFILE, f"{out}/plan"]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stderr.rstrip()


def main(flags: Startup) -> None:
    """Print a line for each command, tree and state of the cache, and where the warm time goes."""
    trees = [_HERE / "src", *([] if flags.also is None else [flags.also.resolve()])]
    with tempfile.TemporaryDirectory() as folder:
        caches = {tree: Path(folder) / str(number) for number, tree in enumerate(trees)}
        for command in ("plan", "live"):
            for number in range(1 + flags.repeat):
                for tree in trees:
                    found = cost(command, tree, caches[tree] / command)
                    state = "warm" if number else "cold"
                    print(
                        f"{command} {state}  {found.wall:6.2f} s  {found.cpu:6.2f} s of CPU  {found.memory:5.0f} MiB  "
                        f"{tree}",
                        flush=True,
                    )
        for tree in trees:
            print(f"CPU seconds of a warm run of maipp plan, {tree}:\n{profile(tree, caches[tree] / 'plan')}")


if __name__ == "__main__":
    main(tyro.cli(Startup))
