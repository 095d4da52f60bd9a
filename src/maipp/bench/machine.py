"""What a measurement ran on: without it neither its times nor its last digits mean much."""

import importlib.metadata
import platform
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
