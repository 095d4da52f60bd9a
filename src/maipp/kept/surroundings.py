"""What a program is made of besides its arguments: source, versions, JAX's options, the machine."""

import hashlib
import os
import platform
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax

_PACKAGE = Path(__file__).parents[1]
_MADE_BY = ("jax", "jaxlib", "equinox", "numpy")

# Options that say where programs are kept, or what is printed meanwhile.
_NO_MATTER = ("cache", "log", "_dump", "traceback", "explain", "pprint")


@cache
def source() -> str:
    """A digest of maipp's source."""
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(_PACKAGE)} {len(content)} ".encode())
        digest.update(content)
    return digest.hexdigest()


@cache
def platform_here() -> str:
    """What compiles and runs in this process: versions, devices, the machine and XLA's flags."""
    versions = [f"{name} {version(name)}" for name in _MADE_BY]
    devices = [(device.id, device.device_kind) for device in jax.local_devices()]
    backend = jax.local_devices()[0].client.platform_version
    flags = os.environ.get("XLA_FLAGS", ""), os.environ.get("NPROC", "")
    return repr((versions, sys.version, devices, backend, flags, _machine()))


def options() -> tuple[tuple[str, Any], ...]:
    """JAX's options as they are now, in this thread."""
    values = jax.config.values
    return tuple((name, values[name]) for name in values if not any(part in name for part in _NO_MATTER))


@cache
def _machine() -> str:
    """The processor and what it can do; compiled code may use all of that."""
    about = platform.machine(), platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").partition("\n\n")[0].splitlines()
    except OSError:  # not Linux: a machine is known by its name
        return repr((*about, platform.node()))
    told = ("model name", "cpu family", "model", "stepping", "vendor_id", "flags", "Features", "CPU part")
    return repr((*about, [line for line in lines if line.partition(":")[0].strip() in told]))
