"""NetCDF 4 read apart as `maipp.fields.netcdf_apart` does, by forks of one process that has its imports done.

A new interpreter for each of ten thousand inputs would take an hour. Run as a script, this is that one process.
"""

import atexit
import json
import os
import select
import signal
import subprocess
import sys
import time
from functools import cache

from maipp.fields import netcdf_apart

_LATE = "late"


def reply_to(request: bytes, seconds: float) -> bytes:
    """In place of `netcdf_apart.reply_to`: the same answers and errors."""
    server = _server()
    assert server.stdin is not None and server.stdout is not None
    server.stdin.write(request + b"\n")
    server.stdin.flush()
    code, size = json.loads(server.stdout.readline())
    answer = server.stdout.read(size)
    if code == _LATE:
        raise subprocess.TimeoutExpired("fork", seconds)
    if code:
        raise subprocess.CalledProcessError(code, "fork")
    return answer


@cache
def _server() -> subprocess.Popen[bytes]:
    command = [sys.executable, "-P", __file__]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "OPENBLAS_NUM_THREADS": "1"}
    server = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
    )
    atexit.register(server.communicate)  # at the end of its input it ends
    return server


def _serve() -> None:
    """Answer the requests on standard input, one a line."""
    import h5netcdf  # noqa: F401 - what each fork needs
    import xarray  # noqa: F401

    for line in sys.stdin.buffer:
        request = json.loads(line)
        del request["sys_path"]
        code, answer = _forked(request)
        sys.stdout.buffer.write(json.dumps([code, len(answer)]).encode() + b"\n" + answer)
        sys.stdout.buffer.flush()


def _forked(request: dict) -> tuple[int | str, bytes]:
    """How a fork that reads the file ended, and what it wrote."""
    out, into = os.pipe()
    fork = os.fork()
    if not fork:
        try:
            os.dup2(into, 1)
            os.close(into)
            netcdf_apart.answer(**request)
        finally:
            os._exit(1)
    os.close(into)
    until, parts, late = time.monotonic() + request["seconds"], [], False
    while not late:
        late = not select.select([out], [], [], max(until - time.monotonic(), 0))[0]
        if not late:
            parts.append(os.read(out, 2**20))
            if not parts[-1]:
                break
    if late:
        os.kill(fork, signal.SIGKILL)
    os.close(out)
    code = os.waitstatus_to_exitcode(os.waitpid(fork, 0)[1])
    return (_LATE if late else code), b"".join(parts)


if __name__ == "__main__":
    _serve()
