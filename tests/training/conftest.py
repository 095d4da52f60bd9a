"""The fake learner, for tests of everything around the real one."""

import importlib.util
from pathlib import Path

import pytest

FAKE_RUN = Path(__file__).with_name("fake_run.py")


@pytest.fixture(scope="session")
def fake():
    spec = importlib.util.spec_from_file_location("maipp_tests_fake_run", FAKE_RUN)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
