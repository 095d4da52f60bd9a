"""Checkpoints of a training run: whole or not there, whenever the process is killed.

One folder for each, named by its update: the arrays in safetensors files of at most 16 MiB (as far as no single array
is larger), and `checkpoint.json` with the digest of each. It is written under a hidden name and renamed when complete.
"""

import hashlib
import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from maipp.errors import InputError
from maipp.files import sync_folder

SCHEMA = "maipp.checkpoint/1"
CARD = "checkpoint.json"
KEPT = 2  # newest checkpoints; the one before stands in should the disk damage the last
FILE_BYTES = 2**24  # what a machine that returns only small files lets through

PyTree = Any


def save_checkpoint(folder: Path, update: int, arrays: PyTree, about: Mapping[str, Any]) -> Path:
    """Write the NumPy arrays of a state as checkpoint `update` in `folder`, remove old ones, and give its path.

    `about` is anything JSON can hold. One that exists is left as it is: the same run gives the same state.
    Raises InputError where it cannot be written.
    """
    target = folder / f"{update:06d}"
    stage = folder / f".{target.name}"
    try:
        if not target.exists():
            folder.mkdir(parents=True, exist_ok=True)
            shutil.rmtree(stage, ignore_errors=True)
            stage.mkdir()
            digests = {}
            for index, tensors in enumerate(_packed(_named(arrays))):
                name = f"state-{index:02d}.safetensors"
                content = save(tensors)
                _write(stage / name, content)
                digests[name] = hashlib.sha256(content).hexdigest()
            card = {"schema": SCHEMA, "update": update, **about, "files": digests}
            _write(stage / CARD, (json.dumps(card, indent=2, allow_nan=False) + "\n").encode())
            sync_folder(stage)
            os.rename(stage, target)
            sync_folder(folder)
        _remove([*checkpoints(folder)[:-KEPT], *folder.glob(".*")])
    except OSError as error:
        raise InputError(f"{target}: cannot be written: {error.strerror or error}") from error
    return target


def checkpoints(folder: Path) -> list[Path]:
    """The checkpoints in a folder, oldest first."""
    return sorted((path for path in folder.glob("[0-9]*") if path.is_dir()), key=lambda path: int(path.name))


def load_latest(folder: Path, like: PyTree) -> tuple[PyTree, dict[str, Any]] | None:
    """The arrays and the card of the newest whole checkpoint; None where there is none.

    Damaged ones are removed. `like` has the structure, shapes and dtypes of the state as `to_host` gives it.
    Raises InputError where a whole checkpoint holds another state, which is one of another version.
    """
    for path in reversed(checkpoints(folder)):
        read = _read(path)
        if read is not None:
            return _state(read[0], like, path), read[1]
        _remove([path])
    return None


def latest_card(folder: Path) -> dict[str, Any] | None:
    """The card of the newest whole checkpoint; None where there is none."""
    cards = (read[1] for path in reversed(checkpoints(folder)) if (read := _read(path)) is not None)
    return next(cards, None)


def _named(tree: PyTree) -> dict[str, np.ndarray]:
    """The leaves by their path."""
    leaves = jax.tree_util.tree_flatten_with_path(tree)[0]
    return {jax.tree_util.keystr(path, simple=True, separator="."): leaf for path, leaf in leaves}


def _packed(tensors: dict[str, np.ndarray]) -> list[dict[str, np.ndarray]]:
    """The tensors in groups that each fit a file."""
    groups: list[dict[str, np.ndarray]] = [{}]
    room = FILE_BYTES
    for name, tensor in tensors.items():
        need = tensor.nbytes + 512  # its line in the file's header
        if need > room and groups[-1]:
            groups.append({})
            room = FILE_BYTES
        groups[-1][name] = np.ascontiguousarray(tensor).reshape(tensor.shape)  # which makes 0-d arrays 1-d
        room -= need
    return groups


def _write(path: Path, content: bytes) -> None:
    """The file, on the disk when this returns."""
    with open(path, "xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _remove(paths: list[Path]) -> None:
    """Remove folders; hidden first, so that a kill leaves none that looks like a checkpoint."""
    for path in paths:
        hidden = path
        if not path.name.startswith("."):
            hidden = path.with_name(f".old-{path.name}")
            shutil.rmtree(hidden, ignore_errors=True)
            os.rename(path, hidden)
        shutil.rmtree(hidden, ignore_errors=True)


def _read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]] | None:
    """Tensors and card of a checkpoint; None where anything is missing or not what was written."""
    try:
        card = json.loads((path / CARD).read_bytes())
        schema = card["schema"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    if schema != SCHEMA:
        raise InputError(f"{path}: schema: {schema!r} is not one this version reads; it reads {SCHEMA!r}")
    tensors = {}
    try:
        for name, digest in card["files"].items():
            content = (path / name).read_bytes()
            if hashlib.sha256(content).hexdigest() != digest:
                return None
            tensors |= load(content)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, SafetensorError):
        return None
    return tensors, card


def _state(tensors: dict[str, np.ndarray], like: PyTree, path: Path) -> PyTree:
    """The tensors in the structure of `like`."""
    expected = _named(like)
    if differing := sorted(set(tensors) ^ set(expected)):
        raise InputError(f"{path}: {differing[0]}: not in both the checkpoint and this version's state; start anew")
    for name, leaf in expected.items():
        found = tensors[name]
        if (found.shape, found.dtype) != (leaf.shape, leaf.dtype):
            raise InputError(
                f"{path}: {name} is {found.dtype}{list(found.shape)}, this version's {leaf.dtype}{list(leaf.shape)}; "
                "resume with the version, the configuration and the precision that wrote it"
            )
    return jax.tree.unflatten(jax.tree.structure(like), [tensors[name] for name in expected])
