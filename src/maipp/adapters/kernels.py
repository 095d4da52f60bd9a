"""Small programs in few kernels: XLA on a CPU starts every small operation by itself, which takes longer than it runs.

A step of one world is some 130 such operations. Here those between two calls of LAPACK are compiled as one.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from importlib.metadata import version
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, Var, jaxpr_as_fun

# What XLA compiles as a call of a library, or leaves out where it compiles a kernel of many operations.
_APART = {
    *("cholesky", "triangular_solve", "lu", "eigh", "svd", "fft", "sort", "top_k", "conv_general_dilated", "ffi_call"),
    *("pure_callback", "io_callback", "debug_callback"),
}
_CALLS = {"jit": "jaxpr", "custom_jvp_call": "call_jaxpr"}  # that are the program within, and where that is
# Quicker than to pass on.
_FREE = {"slice", "reshape", "squeeze", "convert_element_type", "bitcast_convert_type", "broadcast_in_dim", "iota"}

# XLA keeps such a call, and compiles it as one kernel. It says so nowhere, and ends the process over what it cannot
# compile: with versions that this was not tried with, functions stay as they are.
_TRIED = ("0.10.",)
_ONE_KERNEL = {"inlineable": "false", "xla_cpu_small_call": "true"}
_LARGE = 2**16  # multiplications of a matrix product that a library computes faster
_LEAST = 4  # operations that are worth a call

# For `jax.jit` of such a function: a kernel cannot call XLA's library of matrix products, which gains little here.
OPTIONS = {"xla_disable_hlo_passes": "dot-library-rewriter"}


class _Operation(NamedTuple):
    equation: JaxprEqn
    inputs: list[Any]  # numbers of values, or literals
    outputs: list[int]
    apart: bool
    free: bool  # of constants and arguments only
    origin: Any  # the debugging information of its program


def few_kernels(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same function, to be compiled with `OPTIONS`: on a CPU in as few kernels as LAPACK allows.

    Results are the same up to rounding. For arrays of up to some thousand numbers: one kernel uses no more than one
    core, and no library.
    """

    def run(*args: Any) -> Any:
        if jax.default_backend() != "cpu" or not version("jaxlib").startswith(_TRIED):
            return function(*args)
        program, shapes = jax.make_jaxpr(function, return_shape=True)(*args)
        outputs = _Plan(program).run(jax.tree.leaves(args))
        return jax.tree.unflatten(jax.tree.structure(shapes), outputs)

    return run


class _Plan:
    """The operations of a program in stages: those of a stage are one kernel, after which come those apart."""

    def __init__(self, program: ClosedJaxpr) -> None:
        self.operations: list[_Operation] = []
        self.free: set[int] = set()
        self.values = 0
        inner = program.jaxpr
        self.constants = {self._new(free=True): const for const in program.consts}
        numbers: dict[Var, Any] = dict(zip(inner.constvars, self.constants, strict=True))
        self.arguments = [self._new(free=True) for _ in inner.invars]
        numbers |= zip(inner.invars, self.arguments, strict=True)
        self._list(inner, numbers)
        self.outputs = [_read(numbers, each) for each in inner.outvars]
        self.operations = self._needed()

    def _new(self, *, free: bool) -> int:
        self.values += 1
        if free:
            self.free.add(self.values)
        return self.values

    def _list(self, program: Jaxpr, numbers: dict[Var, Any]) -> None:
        """All operations in order; those of calls that have to be cut as if there were no call."""
        for equation in program.eqns:
            inputs = [_read(numbers, each) for each in equation.invars]
            apart, name = _is_apart(equation), equation.primitive.name
            if apart and name in _CALLS:
                closed: ClosedJaxpr = equation.params[_CALLS[name]]
                within: dict[Var, Any] = dict(zip(closed.jaxpr.invars, inputs, strict=True))
                for var, const in zip(closed.jaxpr.constvars, closed.consts, strict=True):
                    within[var] = self._new(free=True)
                    self.constants[within[var]] = const
                self._list(closed.jaxpr, within)
                results = [_read(within, each) for each in closed.jaxpr.outvars]
                numbers |= zip(equation.outvars, results, strict=True)
                continue
            free = name in _FREE and all(each in self.free for each in inputs if isinstance(each, int))
            outputs = [self._new(free=free) for _ in equation.outvars]
            numbers |= zip(equation.outvars, outputs, strict=True)
            self.operations.append(_Operation(equation, inputs, outputs, apart, free, program.debug_info))

    def _needed(self) -> list[_Operation]:
        """Those that the outputs depend on."""
        needed, kept = {each for each in self.outputs if isinstance(each, int)}, []
        for each in reversed(self.operations):
            if needed.intersection(each.outputs):
                kept.append(each)
                needed |= {value for value in each.inputs if isinstance(value, int)}
        return kept[::-1]

    def run(self, arguments: list[Any]) -> list[Any]:
        """The outputs, traced."""
        known: dict[int, Any] = self.constants | dict(zip(self.arguments, arguments, strict=True))
        _evaluate([each for each in self.operations if each.free], known)
        stages, apart = self._stages()
        for stage, operations in enumerate(stages):
            later = [each for rest in (*stages[stage + 1 :], *apart[stage:]) for each in rest]
            read = {value for each in later for value in each.inputs if isinstance(value, int)}
            read |= {value for value in self.outputs if isinstance(value, int)}
            self._kernel(operations, read, known)
            _evaluate(apart[stage], known)
        return [_value(each, known) for each in self.outputs]

    def _stages(self) -> tuple[list[list[_Operation]], list[list[_Operation]]]:
        """The operations of each kernel, and those apart that come after it."""
        ready: dict[int, int] = {}
        stages: list[list[_Operation]] = [[]]
        apart: list[list[_Operation]] = [[]]
        for each in self.operations:
            if each.free:
                continue
            stage = max((ready.get(value, 0) for value in each.inputs if isinstance(value, int)), default=0)
            ready |= dict.fromkeys(each.outputs, stage + each.apart)
            while len(stages) <= stage:
                stages.append([])
                apart.append([])
            (apart if each.apart else stages)[stage].append(each)
        return stages, apart

    def _kernel(self, operations: list[_Operation], read: set[int], known: dict[int, Any]) -> None:
        """Compute these, as one kernel where there are enough of them; `known` is given what is read later."""
        if len(operations) < _LEAST:
            return _evaluate(operations, known)
        made = {value for each in operations for value in each.outputs}
        results = sorted(made & read)
        free = [each for each in self.operations if each.free]
        read_here = {*self.arguments, *self.constants, *self._passed(operations, made)}
        empty = {value: jnp.zeros_like(known[value]) for value in read_here if not jnp.size(known[value])}
        given = sorted(read_here - empty.keys())

        def kernel(*values: Any) -> list[Any]:
            here = empty | dict(zip(given, values, strict=True))
            _evaluate(free, here)
            _evaluate(operations, here)
            return [_touch(values), *(here[value] for value in results)]

        outputs = set_xla_metadata(jax.jit(kernel)(*(known[value] for value in given)), **_ONE_KERNEL)
        _, *outputs = lax.optimization_barrier(outputs)  # so that the first is kept
        known.update(zip(results, outputs, strict=True))
        return None

    def _passed(self, operations: list[_Operation], made: set[int]) -> set[int]:
        """What earlier operations must pass on."""
        read = {value for each in operations for value in each.inputs if isinstance(value, int)}
        return read - made - self.free


def _read(numbers: Mapping[Var, Any], atom: Any) -> Any:
    return atom if isinstance(atom, Literal) else numbers[atom]


def _touch(values: Iterable[Any]) -> Any:
    """A number that depends on all of these: XLA ends the process over an argument that a kernel does not read."""
    return sum(jnp.ravel(value)[0].astype(float) for value in values)


def _value(value: Any, known: Mapping[int, Any]) -> Any:
    if not isinstance(value, Literal):
        return known[value]
    kind: Any = value.aval
    return np.asarray(value.val, kind.dtype)


def _evaluate(operations: Iterable[_Operation], known: dict[int, Any]) -> None:
    """Trace these operations; `known` has their values afterwards."""
    for each in operations:
        equation = each.equation
        pairs = zip(equation.invars, each.inputs, strict=True)
        inputs = {var: _value(value, known) for var, value in pairs if not isinstance(var, Literal)}
        alone = Jaxpr((), list(inputs), equation.outvars, [equation], equation.effects, debug_info=each.origin)
        known.update(zip(each.outputs, jaxpr_as_fun(ClosedJaxpr(alone, ()))(*inputs.values()), strict=True))


def _is_apart(equation: JaxprEqn) -> bool:
    """Whether the operation, or one within it, can be no part of a kernel, or should be none."""
    kinds: list[Any] = [atom.aval for atom in (*equation.invars, *equation.outvars)]
    if any(jnp.issubdtype(kind.dtype, jax.dtypes.prng_key) for kind in kinds):
        return True
    if equation.primitive.name == "dot_general":
        contracted = equation.params["dimension_numbers"][0][0]
        return math.prod(kinds[-1].shape) * math.prod(kinds[0].shape[axis] for axis in contracted) > _LARGE
    within, name = _programs(equation.params.values()), equation.primitive.name
    return name in _APART or "scatter" in name or any(_is_apart(each) for program in within for each in program.eqns)


def _programs(parameters: Iterable[Any]) -> list[Jaxpr]:
    """Those within an operation."""
    found: list[Jaxpr] = []
    for value in parameters:
        if isinstance(value, ClosedJaxpr):
            found.append(value.jaxpr)
        elif isinstance(value, Jaxpr):
            found.append(value)
        elif isinstance(value, tuple | list):
            found += _programs(value)
    return found
