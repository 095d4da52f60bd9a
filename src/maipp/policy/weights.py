"""Weights as files: float32 tensors in safetensors, with a JSON card beside them that says what they are."""

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from safetensors import SafetensorError, deserialize
from safetensors.numpy import save

from maipp.errors import InputError
from maipp.files import write_atomic
from maipp.policy.network import PolicyNetwork

SCHEMA = "maipp.policy/1"

# The architecture's sizes and the largest a card may ask for: a slip of the pen must not fill the memory.
_LARGEST = {"width": 8192, "heads": 8192, "encoder_layers": 64, "encoding_dimensions": 8192}
StrPath = str | os.PathLike[str]


def save_weights(network: PolicyNetwork, path: StrPath, card: dict[str, Any]) -> None:
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
    full = {**card, "schema": SCHEMA, "architecture": network.architecture, "sha256": _digest(content)}
    try:
        text = json.dumps(full, indent=2, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"{card_path}: not written: the card cannot be JSON: {error}") from None
    write_atomic(target, content)
    write_atomic(card_path, text + "\n")


def load_weights(path: StrPath) -> tuple[PolicyNetwork, dict[str, Any]]:
    """The network in a file that `save_weights` wrote, and its card.

    Raises InputError naming the file where either file is missing, is not what it should be, or does not belong to
    the other.
    """
    target, card_path = _paths(path)
    card = _read_card(card_path)
    architecture = _architecture(card, card_path)
    content = _read(target)
    try:
        tensors = dict(deserialize(content))
    except SafetensorError as error:
        raise InputError(f"{target}: not a safetensors file, or cut short: {error}") from None
    try:
        shape = eqx.filter_eval_shape(PolicyNetwork, jax.random.key(0), **architecture)
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
    if card["sha256"] != _digest(content):
        raise InputError(f"{target}: not the weights that {card_path.name} describes (sha256 differs); copy both files")
    return jax.tree.unflatten(jax.tree.structure(shape), leaves), card


def _paths(path: StrPath) -> tuple[Path, Path]:
    """The paths of the weights and of their card."""
    target = Path(path)
    if target.suffix != ".safetensors":
        raise InputError(
            f"{target}: weights are a .safetensors file, their card a .json file of the same name beside it"
        )
    return target, target.with_suffix(".json")


def _named(network: PolicyNetwork) -> dict[str, Any]:
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


def _read_card(path: Path) -> dict[str, Any]:
    """The card, with all the keys it must have."""
    content = _read(path)
    try:
        card = json.loads(content)
        json.dumps(card, allow_nan=False)  # Python reads NaN and 1e999, which are no JSON and no results
    except (ValueError, RecursionError) as error:  # not UTF-8, not JSON, nested too deeply
        raise InputError(f"{path}: not JSON, or cut short: {error}") from None
    if not isinstance(card, dict):
        raise InputError(f"{path}: must hold a JSON object, the card of the weights")
    for key in ("schema", "architecture", "sha256"):
        if key not in card:
            raise InputError(f"{path}: {key} is missing; the card must hold it")
    if card["schema"] != SCHEMA:
        raise InputError(f"{path}: schema: {card['schema']!r} is not one this version reads; it reads {SCHEMA!r}")
    return card


def _architecture(card: dict[str, Any], path: Path) -> dict[str, Any]:
    """The arguments of `PolicyNetwork` that the card names, checked."""
    architecture = card["architecture"]
    if not isinstance(architecture, dict):
        raise InputError(f"{path}: architecture must be an object of keys and values")
    known = (*_LARGEST, "use_intent")
    for key in known:
        if key not in architecture:
            raise InputError(f"{path}: architecture.{key} is missing; the card must hold it")
    for key, value in architecture.items():
        if key not in known:
            raise InputError(f"{path}: architecture.{key} is unknown to this version; it knows {', '.join(known)}")
        if key == "use_intent" and not isinstance(value, bool):
            raise InputError(f"{path}: architecture.use_intent is {value!r}; it must be true or false")
        if key != "use_intent" and (type(value) is not int or not 1 <= value <= _LARGEST[key]):
            raise InputError(
                f"{path}: architecture.{key} is {value!r}; it must be a whole number from 1 to {_LARGEST[key]}"
            )
    return architecture


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
