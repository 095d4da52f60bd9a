"""NetCDF 4 files read in a process of their own, which is ended where HDF5 does not end.

HDF5 is C code. On a damaged file it may run without end, where no signal handler of Python's gets its turn, or take its
process down with it.
"""

import faulthandler
import json
import math
import operator
import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from maipp.errors import InputError, one_line
from maipp.fields.netcdf_grid import NetcdfGrid, read_grid

SECONDS = 30.0  # for a small file: from a slow disk, the imports alone may take ten
BYTES_A_SECOND = 4e6  # more for a large file: a slow network; HDF5 itself is twenty times as fast
MEMORY = 4 * 2**30  # of addresses, in bytes; 25 million cells need 0.7, and a damaged file may ask for any number
LATER = 5.0  # seconds after which the process ends by itself, where whoever started it is gone
_ARRAYS = ("values", "x", "y")

# The path is the parent's, so that both read with the same packages.
PROGRAM = """
import json, sys
request = json.loads(sys.stdin.buffer.read())
sys.path[:] = request.pop("sys_path")
from maipp.fields.netcdf_apart import answer
answer(**request)
"""


def read_apart(path: Path, value: str | None, at: Mapping[str, int]) -> NetcdfGrid:
    """What `read_grid` returns or raises, read by another process within a limit of time and memory.

    Raises InputError as well where the process is not done in time, and where it dies.
    """
    seconds = SECONDS + path.stat().st_size / BYTES_A_SECOND
    asked = {
        "path": str(path),
        "value": value,
        "at": dict(at),
        "seconds": seconds,
        "sys_path": list(map(str, sys.path)),
    }
    try:
        reply = reply_to(json.dumps(asked, default=operator.index).encode(), seconds)
    except subprocess.TimeoutExpired:
        raise InputError(f"{path}: damaged, HDF5 was not done with it after {seconds:.0f} s; get it anew") from None
    except subprocess.CalledProcessError as error:
        end = _end(error.returncode)
        raise InputError(f"{path}: HDF5 broke off reading it ({end}); damaged, or memory is short") from None
    except OSError as error:
        raise InputError(f"{path}: {sys.executable or 'Python'} does not start to read it ({error.strerror})") from None
    return _unpacked(reply)


def reply_to(request: bytes, seconds: float) -> bytes:
    """What a new process answers; it is gone when this returns or raises.

    Raises `subprocess.TimeoutExpired` and `subprocess.CalledProcessError`.
    """
    flags = ["-I" if sys.flags.isolated else "-P", "-X", f"utf8={sys.flags.utf8_mode}"]
    return subprocess.run(
        [sys.executable, *flags, "-c", PROGRAM],
        input=request,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        timeout=seconds,
        check=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # each would take addresses of its own
    ).stdout


def answer(path: str, value: str | None, at: Mapping[str, int], seconds: float) -> NoReturn:
    """Write the grid, or why there is none, to standard output, and end the process."""
    out = os.fdopen(os.dup(1), "wb")
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)  # whatever else is written
    faulthandler.dump_traceback_later(seconds + LATER, exit=True, file=silent)
    _bound()
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            grid = read_grid(Path(path), value, at)
    except InputError as error:
        head, arrays = {"error": str(error)}, {}
    else:
        head = {item.name: getattr(grid, item.name) for item in fields(grid)}
        parts = {name: head.pop(name) for name in _ARRAYS}
        arrays = {name: np.ascontiguousarray(part) for name, part in parts.items() if part is not None}
        head["arrays"] = {name: (array.dtype.str, array.shape) for name, array in arrays.items()}
        head["told"] = [str(w.message) for w in caught if issubclass(w.category, UserWarning | RuntimeWarning)]
    out.write(json.dumps(head).encode() + b"\n")
    for array in arrays.values():
        out.write(array.data)
    out.flush()
    os._exit(0)  # whatever HDF5 still holds


def _bound() -> None:
    """Bound the memory of this process, and leave no core file when it dies."""
    try:
        import resource
    except ImportError:  # Windows
        return
    for what, most in ((resource.RLIMIT_AS, MEMORY), (resource.RLIMIT_CORE, 0)):
        soft, hard = resource.getrlimit(what)
        with suppress(ValueError, OSError):  # macOS refuses some
            resource.setrlimit(what, (most if soft == resource.RLIM_INFINITY else min(most, soft), hard))


def _unpacked(reply: bytes) -> NetcdfGrid:
    """The grid that `answer` wrote. Raises InputError where it wrote why there is none."""
    end = reply.index(b"\n") + 1
    head: dict[str, Any] = json.loads(reply[:end])
    if "error" in head:
        raise InputError(head["error"])
    for text in head.pop("told"):
        warnings.warn(one_line(text), stacklevel=2)
    for name, (dtype, shape) in head.pop("arrays").items():
        array = np.frombuffer(reply, dtype, math.prod(shape), end).reshape(shape)
        head[name], end = array, end + array.nbytes
    return NetcdfGrid(**head)


def _end(code: int) -> str:
    """How a process ended that did not end well."""
    return (code < 0 and signal.strsignal(-code)) or f"exit code {code} of {sys.executable}"
