"""A function as compiled programs, each read from the store where it is there, else compiled and put there."""

import functools
import hashlib
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.experimental.serialize_executable import deserialize_and_load, serialize

from maipp.kept import store
from maipp.kept.names import UnnamedError, array_name, name_of
from maipp.kept.surroundings import options, origin

# With one of these on, JAX looks into what it traces or runs: that is for JAX itself to do.
_WATCHED = (
    *("jax_disable_jit", "jax_debug_nans", "jax_debug_infs", "jax_check_tracer_leaks", "jax_debug_key_reuse"),
    *("jax_enable_checks", "jax_no_tracing", "jax_no_execution"),
)


@dataclass(frozen=True)
class _Array:
    """In a result: the place of the array of this number."""

    number: int


class _Program(NamedTuple):
    """Compiled: takes the arrays among the leaves of the arguments, gives those among the leaves of the result."""

    run: Callable[..., Any]
    result: Any  # with an `_Array` in the place of each

    def __call__(self, leaves: list[Any]) -> Any:
        arrays = self.run(*filter(eqx.is_array, leaves))
        return jax.tree.map(lambda leaf: arrays[leaf.number] if isinstance(leaf, _Array) else leaf, self.result)


class Kept:
    """What `kept` makes of a function; `__wrapped__` is the function itself."""

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self._function = function
        self._jit = eqx.filter_jit(function)
        self._programs: dict[Any, _Program | None] = {}  # None: for JAX to compile

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """The function's result."""
        leaves, tree = jax.tree.flatten((args, kwargs))
        if not _usable() or any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
            return self._jit(*args, **kwargs)
        try:
            call = tree, options(), tuple(map(_signature, leaves))
            known = call in self._programs
        except (TypeError, UnnamedError):  # not hashable, or spread over devices in another way
            return self._jit(*args, **kwargs)
        if not known:
            self._programs[call] = self._found(args, kwargs, leaves, tree)
        program = self._programs[call]
        return self._jit(*args, **kwargs) if program is None else program(leaves)

    def _found(self, args: Any, kwargs: Any, leaves: list[Any], tree: Any) -> _Program | None:
        """The program of this call, from the store or compiled; None where no name stands for it."""
        function = f"{self._function.__module__}.{self._function.__qualname__}"
        try:
            made_of = repr((origin(), function, name_of((args, kwargs)), options()))
        except UnnamedError:
            return None
        name = f"{self._function.__name__.strip('_')}-{hashlib.sha256(made_of.encode()).hexdigest()}"
        return _read(name) or self._compiled(name, leaves, tree)

    def _compiled(self, name: str, leaves: list[Any], tree: Any) -> _Program:
        """Compile the program, and keep it."""
        result: Any = None

        @functools.wraps(self._function)
        def flat(*arrays: jax.Array) -> list[jax.Array]:
            nonlocal result
            rest = iter(arrays)
            args, kwargs = tree.unflatten([next(rest) if eqx.is_array(leaf) else leaf for leaf in leaves])
            outputs, shape = jax.tree.flatten(self._function(*args, **kwargs))
            places = [number for number, leaf in enumerate(outputs) if eqx.is_array(leaf)]
            numbered = dict(zip(places, map(_Array, range(len(places))), strict=True))
            result = shape.unflatten([numbered.get(number, leaf) for number, leaf in enumerate(outputs)])
            return [outputs[place] for place in places]

        lowered = jax.jit(flat).lower(*filter(eqx.is_array, leaves))
        compiled = lowered.compile()
        if "callback" not in lowered.as_text():  # an address in this process
            _write(name, compiled, result)
        return _Program(compiled, result)


def kept(function: Callable[..., Any]) -> Kept:
    """As `equinox.filter_jit`, and the compiled programs are kept in `devices.cache_folder` for processes to come.

    Arrays among the arguments are traced, all else is static. The function must be one of a module, and depend on
    nothing but its arguments and the source. On accelerators, and inside what JAX traces, it is `equinox.filter_jit`.
    """
    return Kept(function)


def _usable() -> bool:
    values = jax.config.values
    watched = any(values.get(name) for name in _WATCHED)
    return not watched and store.folder() is not None and jax.default_backend() == "cpu" and jax.process_count() == 1


def _signature(leaf: Any) -> tuple[Any, ...]:
    return array_name(leaf) if eqx.is_array(leaf) else ("static", type(leaf), leaf)


def _read(name: str) -> _Program | None:
    """The program of this name; None where there is none that can be used here."""
    content = store.read(name)
    if content is None:
        return None
    try:
        devices, *program, result = pickle.loads(content)
        _ready_lapack()
        here = {device.id: device for device in jax.local_devices()}
        compiled = deserialize_and_load(*program, execution_devices=[here[number] for number in devices])
    except Exception:  # whatever a file made by something else brings about: it is compiled anew
        return None
    return _Program(compiled, result)


def _write(name: str, compiled: jax.stages.Compiled, result: Any) -> None:
    """Keep a program, where JAX can write it down."""
    shardings = jax.tree.leaves((compiled.input_shardings, compiled.output_shardings))
    devices = sorted({device.id for sharding in shardings for device in sharding.device_set})
    try:
        content = pickle.dumps((devices, *serialize(compiled), result))
    except Exception:  # such as a function among the result
        return
    store.write(name, content)


@functools.cache
def _ready_lapack() -> None:
    """Have JAX look up LAPACK's functions, which it does when it lowers a call of one, and programs rely on."""
    jax.jit(jax.lax.linalg.cholesky).lower(jax.ShapeDtypeStruct((1, 1), jnp.float32))
