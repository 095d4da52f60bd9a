"""Runs scripts in processes of their own that part once all is imported, which costs more than most of them do then.

Reads a line of JSON for each group: of each process the file that its output goes to, and its arguments, a script
first. All of a group run at the same time; a line with their exit codes answers. See `run_all` in conftest.py.
"""

import json
import os
import runpy
import sys
from pathlib import Path

import maipp.cli.main
import maipp.cli.train
import maipp.training.train  # noqa: F401


def run(told: str, arguments: list[str]) -> None:
    """What Python does that is started with these arguments."""
    file = os.open(told, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(file, 1)
    os.dup2(file, 2)
    sys.argv[:] = arguments
    sys.path[0] = str(Path(arguments[0]).parent)
    runpy.run_path(arguments[0], run_name="__main__")


def main() -> None:
    """Serve until the input ends; in a child, return once its script has."""
    for line in iter(sys.stdin.readline, ""):
        children = []
        for each in json.loads(line):
            child = os.fork()
            if child == 0:
                return run(*each)
            children.append(child)
        codes = [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children]
        print(json.dumps(codes), flush=True)


if __name__ == "__main__":
    main()
