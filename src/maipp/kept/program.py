"""A function as compiled programs, each read from the store where it is there, else compiled and put there."""

import functools
import hashlib
import pickle
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jax.experimental.compilation_cache import compilation_cache
from jax.experimental.serialize_executable import deserialize_and_load, serialize

from maipp.kept import store
from maipp.kept.names import UnnamedError, array_name, name_of
from maipp.kept.surroundings import options, platform_here, source

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
        if not _usable() or any(isinstance(leaf, Tracer) for leaf in leaves):
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
            name = _digest("call", source(), function, name_of((args, kwargs)))
        except UnnamedError:
            return None
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

        given = [leaf for leaf in leaves if eqx.is_array(leaf)]
        lowered = jax.jit(flat).lower(*given)
        text = lowered.as_text()
        if "callback" in text:  # an address in this process
            return _Program(lowered.compile(), result)
        # Arguments that it does not read are not in the text, and yet it must be given as many.
        program = _digest("program", text, *map(str, map(array_name, given)))
        run = _read_program(program)  # other source, the same program
        if run is None:
            run = _compiled_whole(lowered)
            _write_program(program, run)
        _write_call(name, program, result)
        return _Program(run, result)


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


def _digest(kind: str, *parts: str) -> str:
    """The name of a file for what is made of these parts here and now."""
    return f"{kind}-{hashlib.sha256(repr((*parts, platform_here(), options())).encode()).hexdigest()}"


def _read(name: str) -> _Program | None:
    """The program of a call; None where there is none that can be used here."""
    content = store.read(name)
    if content is None:
        return None
    try:
        program, result = pickle.loads(content)
    except Exception:  # whatever a file made by something else brings about: it is traced anew
        return None
    run = _read_program(program)
    return None if run is None else _Program(run, result)


def _read_program(name: str) -> Callable[..., Any] | None:
    """The program of this name, compiled; None where there is none that can be used here."""
    content = store.read(name)
    if content is None:
        return None
    try:
        devices, *program = pickle.loads(content)
        _ready_lapack()
        here = {device.id: device for device in jax.local_devices()}
        return deserialize_and_load(*program, execution_devices=[here[number] for number in devices])
    except Exception:  # as above
        return None


def _write_call(name: str, program: str, result: Any) -> None:
    """Keep which program a call is, and what it gives, where that can be written down."""
    try:
        content = pickle.dumps((program, result))
    except Exception:  # such as a function that has no name
        return
    store.write(name, content)


def _write_program(name: str, compiled: jax.stages.Compiled) -> None:
    """Keep a program, where JAX can write it down."""
    shardings = jax.tree.leaves((compiled.input_shardings, compiled.output_shardings))
    devices = sorted({device.id for sharding in shardings for device in sharding.device_set})
    try:
        content = pickle.dumps((devices, *serialize(compiled)))
    except Exception:  # whatever kind of program cannot be
        return
    store.write(name, content)


_compiling = threading.Lock()


def _compiled_whole(lowered: jax.stages.Lowered) -> jax.stages.Compiled:
    """Compiled without JAX's own cache: what comes from there lacks its code when it is written down again."""
    with _compiling:
        used = jax.config.values["jax_enable_compilation_cache"]
        jax.config.update("jax_enable_compilation_cache", False)
        compilation_cache.reset_cache()  # JAX looks whether there is one once, at its first compilation
        try:
            return lowered.compile()
        finally:
            jax.config.update("jax_enable_compilation_cache", used)
            compilation_cache.reset_cache()


@functools.cache
def _ready_lapack() -> None:
    """Have JAX look up LAPACK's functions, which it does when it lowers a call of one, and programs rely on."""
    jax.jit(jax.lax.linalg.cholesky).lower(jax.ShapeDtypeStruct((1, 1), jnp.float32))
