"""Weights as files: float32 tensors in safetensors, with a JSON card beside them that says what they are."""

import dataclasses
import hashlib
import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from safetensors import SafetensorError, deserialize
from safetensors.numpy import save

from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.policy.network import PolicyNetwork
from maipp.records import Value, Within, read_json
from maipp.renamed import renamed

SCHEMA = "maipp.policy/1"

StrPath = str | os.PathLike[str]

# The largest that a card may ask for: a slip of the pen must not fill the memory.
_Size = Annotated[int, Within(1, most=8192)]


@dataclass(frozen=True)
class _PolicyNetworkArguments:
    """The arguments of `PolicyNetwork` that a card names."""

    width: _Size
    heads: _Size
    encoder_layers: Annotated[int, Within(1, most=64)]
    encoding_dimensions: _Size
    use_intent: bool


class WeightsKind(NamedTuple):
    """What a file of weights holds."""

    schema: str  # that its card names
    architecture: type  # a dataclass: the part of the card that says which network it is
    network: Callable[..., Any]  # of a random key and the values of that dataclass; it has them as its `architecture`


POLICY = WeightsKind(SCHEMA, _PolicyNetworkArguments, PolicyNetwork)


def save_weights(network: Any, path: StrPath, card: dict[str, Any], kind: WeightsKind = POLICY) -> None:
    """Write the weights to `path` (.safetensors) and the card beside them (.json).

    The card is `card` (how the weights were trained, on what, with which result: anything JSON can hold) with the
    keys `schema`, `architecture` and `sha256` of the weights set. Raises InputError where a weight is not finite, the
    card is not JSON, or a file cannot be written.
    """
    target, card_path = _paths(path)
    tensors = {name: np.asarray(leaf) for name, leaf in _named(network).items()}
    for name, tensor in tensors.items():
        if not np.isfinite(tensor).all():
            raise InputError(f"{target}: not written: {name} holds NaN or infinite weights")
    content = save(tensors)
    full = {**card, "schema": kind.schema, "architecture": network.architecture, "sha256": _digest(content)}
    try:
        text = json.dumps(full, indent=2, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"{card_path}: not written: the card cannot be JSON: {error}") from None
    write_atomic(target, content)
    write_atomic(card_path, text + "\n")


def load_weights(path: StrPath, kind: WeightsKind = POLICY) -> tuple[Any, dict[str, Any]]:
    """The network of this kind in a file that `save_weights` wrote, and its card.

    Raises InputError naming the file where either file is missing, is not what it should be, or does not belong to
    the other.
    """
    target, card_path = _paths(path)
    card = _read_card(card_path, kind.schema)
    architecture = dataclasses.asdict(card["architecture"].record(kind.architecture))
    content = _read(target)
    try:
        tensors = dict(deserialize(content))
    except SafetensorError as error:
        raise InputError(f"{target}: not a safetensors file, or cut short: {error}") from None
    try:
        shape = eqx.filter_eval_shape(kind.network, jax.random.key(0), **architecture)
    except InputError as error:
        raise InputError(f"{card_path}: architecture: {error}") from None
    expected = _named(shape)
    if unknown := sorted(set(tensors) - set(expected)):
        raise InputError(f"{target}: {unknown[0]} is not a tensor of the architecture in {card_path.name}")
    leaves = []
    for name, leaf in expected.items():
        if name not in tensors:
            raise InputError(f"{target}: {name} is missing; the architecture in {card_path.name} has it")
        leaves.append(_tensor(tensors[name], leaf.shape, f"{target}: {name}"))
    if card.value["sha256"] != _digest(content):
        raise InputError(f"{target}: not the weights that {card_path.name} describes (sha256 differs); copy both files")
    return jax.tree.unflatten(jax.tree.structure(shape), leaves), card.value


def _paths(path: StrPath) -> tuple[Path, Path]:
    """The paths of the weights and of their card."""
    target = Path(path)
    if target.suffix != ".safetensors":
        raise InputError(
            f"{target}: weights are a .safetensors file, their card a .json file of the same name beside it"
        )
    return target, target.with_suffix(".json")


def _named(network: Any) -> dict[str, Any]:
    """The leaves of the pytree by their path, such as `encoder.0.attention.output.weight`."""
    leaves = jax.tree_util.tree_flatten_with_path(network)[0]
    return {jax.tree_util.keystr(path, simple=True, separator="."): leaf for path, leaf in leaves}


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None


def _read_card(path: Path, schema: str) -> Value:
    """The card, with all the keys it must have."""
    card = read_json(_read(path), str(path))
    for key in ("architecture", "sha256"):
        card[key]
    card["schema"].fit(Literal[schema], f"{schema!r}, the one that this version reads")  # type: ignore[valid-type]
    try:
        json.dumps(card.value, allow_nan=False)  # Python reads NaN and 1e999, which are no JSON and no results
    except ValueError:
        card.wrong("not JSON: holds a number that is not finite")
    return card


def _tensor(tensor: dict[str, Any], shape: tuple[int, ...], where: str) -> jax.Array:
    """The tensor as a float32 array; raises InputError, beginning with `where`, if it is not one of this shape."""
    if tensor["dtype"] != "F32":
        raise InputError(f"{where} is {tensor['dtype']}; it must be F32 (float32)")
    if tuple(tensor["shape"]) != shape:
        raise InputError(f"{where} has shape {tensor['shape']}; the architecture in the card needs {list(shape)}")
    array = np.frombuffer(bytes(tensor["data"]), "<f4").reshape(shape)
    if not np.isfinite(array).all():
        raise InputError(f"{where} holds NaN or infinite weights")
    return jnp.asarray(array)


renamed(__name__, Kind="WeightsKind")
