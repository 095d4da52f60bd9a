"""The static part of a call in words: alike in two processes where both would trace the same program."""

import dataclasses
import enum
import functools
import sys
from collections.abc import Callable, Iterator
from typing import Any

import equinox as eqx
import jax
import numpy as np

# Whose source, or whose version, is part of every name (`surroundings`): a name stands for the code below it.
_KNOWN = ("maipp", "jax", "jaxlib", "equinox", "numpy")


class UnnamedError(Exception):
    """A part whose code or content no name stands for: a closure, or the class of somebody else."""


def name_of(call: Any) -> str:
    """The pytree in words: arrays by shape, type and place, the rest by content. Raises `UnnamedError`."""
    return "".join(_words(call, traced=True))


def array_name(array: Any) -> tuple[Any, ...]:
    """What of an array sets a program apart, hashable. Raises `UnnamedError` for one that is spread in another way."""
    if isinstance(array, np.ndarray | np.generic):
        return "numpy", array.shape, str(array.dtype)
    weak = getattr(array, "weak_type", False)  # keys have none
    return "jax", array.shape, str(array.dtype), weak, array.committed, _place(array.sharding)


def _place(sharding: Any) -> tuple[Any, ...]:
    """Which devices hold an array, and how it is cut."""
    if isinstance(sharding, jax.sharding.SingleDeviceSharding):
        return sharding.memory_kind, *(device.id for device in sharding.device_set)
    if isinstance(sharding, jax.sharding.NamedSharding) and isinstance(sharding.mesh, jax.sharding.Mesh):
        mesh = sharding.mesh
        devices = tuple(device.id for device in mesh.devices.flat)
        return sharding.memory_kind, mesh.axis_names, mesh.devices.shape, devices, str(sharding.spec)
    raise UnnamedError(f"{sharding}")


def _words(thing: Any, traced: bool) -> Iterator[str]:
    """The words of one part; below what is not `traced`, arrays are constants of the program."""
    if thing is None or isinstance(thing, bool | int | float | str | bytes):
        if type(thing).__module__ != "builtins" and not isinstance(thing, np.generic):
            raise UnnamedError(f"{type(thing)}")
        yield f"{type(thing).__name__} {thing!r};"
    elif isinstance(thing, np.ndarray | np.generic | jax.Array):
        if traced:
            yield f"{array_name(thing)};"
        elif isinstance(thing, jax.Array) or thing.dtype.hasobject:
            raise UnnamedError(f"a constant {type(thing)}")
        else:
            yield f"constant {thing.shape} {thing.dtype.str} {thing.tobytes().hex()};"
    elif isinstance(thing, np.dtype):
        yield f"dtype {thing.str};"
    elif isinstance(thing, enum.Enum):
        yield f"{_address(type(thing))}.{thing.name};"
    elif isinstance(thing, functools.partial):
        yield from _group("partial", (thing.func, thing.args, thing.keywords), traced)
    elif isinstance(thing, tuple | list):
        kind = type(thing)
        yield from _group(kind.__name__ if kind in (tuple, list) else _address(kind), thing, traced)
    elif type(thing) is dict:  # in its own order: a loop over it traces in that order
        yield from _group("dict", (part for item in thing.items() for part in item), traced)
    elif isinstance(thing, type) or isinstance(thing, Callable) and hasattr(thing, "__qualname__"):
        yield f"{_address(thing)};"
    elif dataclasses.is_dataclass(thing):
        yield from _fields(thing, traced and isinstance(thing, eqx.Module))
    else:
        raise UnnamedError(f"{type(thing)}")


def _group(kind: str, parts: Any, traced: bool) -> Iterator[str]:
    yield f"{kind}("
    for part in parts:
        yield from _words(part, traced)
    yield ")"


def _fields(thing: Any, traced: bool) -> Iterator[str]:
    """A dataclass; of what is no module, and of static fields, no array is traced."""
    yield f"{_address(type(thing))}("
    for field in dataclasses.fields(thing):
        yield f"{field.name}="
        try:
            value = object.__getattribute__(thing, field.name)
        except AttributeError:
            raise UnnamedError(f"{type(thing)} without {field.name}") from None
        yield from _words(value, traced and not field.metadata.get("static", False))
    yield ")"


def _address(thing: Any) -> str:
    """Where a class or function can be imported from, for those that are what they are called."""
    module, name = getattr(thing, "__module__", None), getattr(thing, "__qualname__", "")
    if not isinstance(module, str) or (module.partition(".")[0] not in _KNOWN and module != "builtins"):
        raise UnnamedError(f"{thing!r}")
    found: Any = sys.modules.get(module)
    for part in name.split("."):
        found = getattr(found, part, None)
    if found is not thing:
        raise UnnamedError(f"{thing!r}")
    return f"{module}.{name}"
