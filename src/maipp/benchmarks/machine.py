"""What a measurement ran on: without it neither its times nor its last digits mean much."""

import importlib.metadata
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from maipp.devices import core_count

PACKAGES = ("maipp", "jax", "jaxlib", "equinox", "numpy")


def versions() -> dict[str, str]:
    """Version of Python and of the packages that decide the numbers."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:  # run from a source tree
            found[package] = "unknown"
    return found


def cpu_model() -> str:
    """The processor's name, or its architecture where the system does not tell."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def machine() -> dict[str, Any]:
    """Processor, cores, system, and the devices and precision that JAX uses."""
    import jax
    import jax.numpy as jnp

    devices = jax.local_devices()
    return {
        "cpu": cpu_model(),
        "cores": core_count(),
        "system": platform.platform(),
        "backend": jax.default_backend(),
        "device": devices[0].device_kind,
        "devices": len(devices),
        "precision": str(jnp.result_type(float)),
    }


def made_on(machine: Mapping[str, Any], versions: Mapping[str, str]) -> str:
    """Machine and versions in words, for the line below a table."""
    devices = f"{machine['devices']} device{'s' if machine['devices'] > 1 else ''}"
    return (
        f"{machine['cpu']}, {machine['cores']} core{'s' if machine['cores'] > 1 else ''}, JAX on {machine['backend']} "
        f"({devices}), {machine['precision']}, maipp {versions['maipp']}, jax {versions['jax']}, "
        f"Python {versions['python']}"
    )


def device_time(seconds: float, what: str) -> str:
    """As `wall_time`, where seconds on several devices count several times."""
    minutes = f"{seconds / 60:.1f} minutes for {what}"
    return f"*Wall time times devices, which does not regenerate: {minutes}; on a CPU a device is a core.*"


def wall_time(seconds: float, what: str) -> str:
    """The line for what changes each time, set apart from the numbers that do not."""
    return f"*Wall time, which does not regenerate: {seconds / 60:.1f} minutes for {what}.*"
