"""Fuzz the readers: `python tests/fuzz/run.py --target all --count 100000`.

Every input is told by its number, so that `--first N --count 1` tries one again. What fails is kept in `--keep`, with
the same kind of failure (the place where it was raised) at most three times. Exit code 1 if anything failed.
`--atheris SECONDS` searches instead with atheris, guided by coverage, from the same seeds (`pip install atheris`).
"""

import argparse
import os
import resource
import signal
import sys
import time
import traceback
from collections import Counter
from pathlib import Path

os.environ.setdefault("JAX_PLATFORMS", "cpu")
sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2] / "src")]

MEMORY = 16 * 2**30  # of addresses: what asks for more would have been refused it, or would have filled the machine
SECONDS = 20  # for one input: no reader needs more for a small file


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--target", nargs="+", default=["all"], help="names, or all")
    parser.add_argument("--count", type=int, default=2000, help="inputs for each target")
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--keep", type=Path, default=Path("out/fuzz"), help="folder for the inputs that fail")
    parser.add_argument("--atheris", type=int, metavar="SECONDS", help="search with atheris for so long instead")
    flags = parser.parse_args()
    if flags.atheris:
        import fuzz_atheris

        return fuzz_atheris.search(flags.target[0], flags.atheris, flags.keep)

    from fuzz_targets import TARGETS

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    signal.signal(signal.SIGALRM, _too_long)
    names = list(TARGETS) if "all" in flags.target else flags.target
    failures = [_run(name, flags.first, flags.count, flags.keep) for name in names]
    return 1 if any(failures) else 0


def _run(name: str, first: int, count: int, keep: Path) -> int:
    """How many of the inputs fail."""
    from fuzz_check import Failure, check, working_folder
    from fuzz_mutate import malformed
    from fuzz_targets import TARGETS

    target = TARGETS[name]
    seeds, accepted, places = target.seeds(), 0, Counter()
    began = time.monotonic()
    with working_folder() as folder:
        for number in range(first, first + count):
            data = malformed(seeds, number, target.tokens)
            signal.alarm(SECONDS)
            try:
                accepted += check(target, data, Path(folder))
            except Failure as failure:
                place = _place(failure)
                places[place] += 1
                if places[place] <= 3:
                    keep.mkdir(parents=True, exist_ok=True)
                    (keep / f"{name}-{number}{target.suffix}").write_bytes(target.pack(data))
                    print(f"{name} {number}: {failure}\n    at {place}", flush=True)
            finally:
                signal.alarm(0)
    failed = sum(places.values())
    seconds = time.monotonic() - began
    print(f"{name}: {count} inputs, {accepted} accepted, {failed} failed, {seconds:.0f} s", flush=True)
    return failed


def _place(failure: BaseException) -> str:
    """Where the cause was raised: the last line of maipp's own in its traceback, and the last of all."""
    cause = failure.__cause__ or failure
    frames = traceback.extract_tb(cause.__traceback__)
    own = [frame for frame in frames if "maipp" in Path(frame.filename).parts] or frames
    return ", ".join(f"{Path(frame.filename).name}:{frame.lineno}" for frame in (own[-1], frames[-1]))


def _too_long(*_: object) -> None:
    raise TimeoutError(f"no answer within {SECONDS} s")


if __name__ == "__main__":
    sys.exit(main())
