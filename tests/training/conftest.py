"""The fake learner, for tests of everything around the real one, and processes that train."""

import importlib.util
import json
import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

FAKE_RUN = Path(__file__).with_name("fake_run.py")
FORKS = Path(__file__).with_name("forks.py")


@pytest.fixture(scope="session")
def fake():
    spec = importlib.util.spec_from_file_location("maipp_tests_fake_run", FAKE_RUN)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def run_all(tmp_path_factory):
    """Run Python with each of the arguments, at the same time; give the exit codes and what was printed."""
    if not hasattr(os, "fork"):
        pytest.skip("processes part by a fork")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    environment.pop("JAX_NUM_CPU_DEVICES", None)  # one device for each process
    folder, pipe = tmp_path_factory.mktemp("told"), subprocess.PIPE
    server = subprocess.Popen(
        [sys.executable, str(FORKS)], env=environment, stdin=pipe, stdout=pipe, text=True, start_new_session=True
    )
    requests, answers = server.stdin, server.stdout
    assert requests is not None and answers is not None

    def run(commands, timeout):
        files = [folder / f"{number}.txt" for number in range(len(commands))]
        group = [(str(file), [str(word) for word in words]) for file, words in zip(files, commands, strict=True)]
        requests.write(json.dumps(group) + "\n")
        requests.flush()
        if not select.select([answers], [], [], timeout)[0]:
            os.killpg(server.pid, signal.SIGKILL)
        codes = json.loads(answers.readline() or "null")
        told = [file.read_text() for file in files]
        assert codes is not None, "\n".join(["still running", *told])
        return codes, told

    try:
        yield run
        requests.close()
        assert server.wait(timeout=60) == 0
    finally:
        if server.poll() is None:
            os.killpg(server.pid, signal.SIGKILL)
            server.wait()
