"""A process ends within two seconds, whatever it is doing when it is told to, and leaves nothing behind."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from maipp.fleet.launch import free_ports

pytest.importorskip("zenoh")

# A robot's process in small: a link that is open, questions that are served, and something to do.
SCRIPT = """
import ctypes, sys, threading, time
from maipp.fleet.ending import Ending
from maipp.fleet.zenoh_link import ZenohLink

doing, port, dead = sys.argv[1:]

def ready():
    print("ready", flush=True)
    sys.stdin.readline()

def compiled():
    mutex = ctypes.create_string_buffer(64)  # zeros are a mutex that nobody holds
    for _ in range(2):  # the second time for ever, whatever signals come
        ctypes.CDLL(None).pthread_mutex_lock(mutex)

def works(ending):
    while not ending.requested.wait(0.02):
        link.receive()
        link.ask("have", b"", 0.2)

def fails():
    time.sleep(0.1)
    raise RuntimeError("a thread has failed")

def answer(question):
    raise RuntimeError("an answer has failed")

with Ending() as ending:
    with ZenohLink("boat-1", "0" * 64, listen=[f"tcp/127.0.0.1:{port}"], connect=[f"tcp/127.0.0.1:{dead}"]) as link:
        link.serve("have", answer if doing == "answer" else bytes)
        ready()
        if doing == "compiled":
            compiled()
        elif doing == "thread":
            threading.Thread(target=fails).start()
            compiled()
        elif doing == "left behind":
            threading.Thread(target=time.sleep, args=(60,)).start()
            works(ending)
        elif doing == "main":
            threading.Thread(target=time.sleep, args=(60,)).start()
            raise ValueError("the main thread has failed")
        elif doing == "answer":
            with ZenohLink("boat-2", "0" * 64, connect=[f"tcp/127.0.0.1:{port}"]) as other:
                while not ending.requested.wait(0.02):
                    other.ask("have", b"", 0.2, "boat-1")
        else:
            works(ending)
sys.exit(ending.code)
"""
SECONDS = 2.0  # what is promised
CASES = [
    ("works", signal.SIGTERM, 128 + signal.SIGTERM),
    ("works", signal.SIGINT, 128 + signal.SIGINT),
    ("compiled", signal.SIGTERM, 128 + signal.SIGTERM),
    ("compiled", signal.SIGINT, 128 + signal.SIGINT),
    ("left behind", signal.SIGTERM, 128 + signal.SIGTERM),
    ("thread", None, 1),
    ("answer", None, 1),
    ("main", None, 1),
]


@pytest.fixture(scope="module")
def processes():
    """One for each case, all started at once, since that is what takes long; and their ports."""
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2] / "src")}
    pipe = subprocess.PIPE
    started = []
    with socket.create_server(("127.0.0.1", 0)) as silent:  # takes connections, and says nothing
        try:
            for (doing, _, _), port in zip(CASES, free_ports(len(CASES)), strict=True):
                command = [sys.executable, "-c", SCRIPT, doing, str(port), str(silent.getsockname()[1])]
                started.append((subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe, stderr=pipe), port))
            for process, _ in started:
                assert process.stdout is not None and process.stdout.readline() == b"ready\n"
            yield started
        finally:
            for process, _ in started:
                process.kill()
                process.communicate()


@pytest.mark.skipif(sys.platform != "linux", reason="the layout of a mutex")
@pytest.mark.parametrize("number", range(len(CASES)), ids=[f"{doing}-{told and told.name}" for doing, told, _ in CASES])
def test_a_process_with_an_open_link_ends(processes, number):
    (_, told, code), (process, port) = CASES[number], processes[number]
    process.stdin.write(b"go\n")
    process.stdin.flush()
    if told is not None:
        time.sleep(0.2)  # until it is at work
        process.send_signal(told)
    begun = time.monotonic()
    _, errors = process.communicate(timeout=20)
    assert time.monotonic() - begun < SECONDS + 0.5  # the machine may be busy
    assert process.returncode == code
    assert (b"has failed" in errors) == (told is None)
    socket.create_server(("127.0.0.1", port)).close()  # nobody listens there any more
