"""What is recorded about the machine."""

from importlib.metadata import version

from maipp.bench.machine import cpu_model, machine, versions
from maipp.devices import core_count


def test_versions_are_those_installed():
    found = versions()
    assert found["jax"] == version("jax") and found["numpy"] == version("numpy")
    assert found["python"].startswith("3.") and "maipp" in found


def test_the_machine_is_described():
    found = machine()
    assert found["cores"] == core_count() >= 1
    assert found["cpu"] == cpu_model() != ""
    assert found["precision"] in ("float32", "float64") and found["devices"] >= 1
