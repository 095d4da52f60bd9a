"""Inputs on which fuzzing once found a reader wanting."""

import json
from pathlib import Path

import numpy as np
import pytest
from fuzz_check import check, working_folder
from fuzz_targets import TARGETS

from maipp.errors import InputError

NPY = TARGETS["raster-npy"].seeds()[0]
EPISODE = json.loads(TARGETS["episode"].seeds()[0])
CARD = json.loads(TARGETS["weights-card"].seeds()[0])


def with_header(text: str) -> bytes:
    """A .npy file whose header is this text."""
    header = text.encode("latin1").ljust(117) + b"\n"
    return NPY[:8] + len(header).to_bytes(2, "little") + header + np.zeros(12).tobytes()


def with_options(**options):
    return json.dumps(EPISODE | {"planner": {"name": "greedy", "options": options}}).encode()


FOUND = {
    "header that Python cannot tokenize": ("raster-npy", with_header("{'descr': ("), "damaged or cut short"),
    "header with a set in a set": ("raster-npy", with_header("{'descr': '<f8', 'shape': {{1}}}"), "damaged"),
    "type of numbers that is no Python": (
        "raster-npy",
        with_header("{'descr': '<,nan', 'fortran_order': False, 'shape': (3, 4), }"),
        "damaged or cut short",
    ),
    "more rows than memory, and no columns": (
        "raster-npy",
        with_header(f"{{'descr': '<i2', 'fortran_order': True, 'shape': ({2**31}, 0), }}"),
        f"at least 2 x 2 values, this one is {2**31} x 0",
    ),
    "more rows than memory, of empty words": (
        "raster-npy",
        with_header(f"{{'descr': '|S0', 'fortran_order': False, 'shape': ({2**31}, 2), }}"),
        "not real numbers",
    ),
    "more rows than a machine counts": (
        "raster-npy",
        with_header("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999, 3), }"),
        "damaged or cut short",
    ),
    "more values than any memory holds": (
        "raster-npz-member",
        with_header("{'descr': '<f8', 'fortran_order': False, 'shape': (900000000000000, 3), }"),
        "damaged or cut short",
    ),
    "terminal code in a cell": ("raster-csv", b"x,y,z\n0,0,1\n0,\x1b[31m,2\n", r"'\x1b[31m' is not a number"),
    "NUL in a cell": ("raster-csv", b"x,y,z\n0,0,1\n0,\x00,2\n", "not text; save it as a plain CSV"),
    "cell of a million digits": (
        "raster-csv",
        b"x,y,z\n0,0," + b"9x" * 500_000 + b"\n",
        "not a CSV file (field larger than field limit",
    ),
    "empty number with a tag": ("training-config", b'entropy: !!float ""\n', "cannot be read"),
    "whole number of 400 digits": ("training-config", b"updates: " + b"9" * 400 + b"\n", "is not a whole number"),
    "entropy that is no number": ("training-config", b"entropy: .inf\n", "entropy: inf is not a finite number"),
    "budget without end": ("training-config", b"budget: [1.0, .inf]\n", "budget[1]: inf does not fit; give [low"),
    "NaN in a card": ("weights-card", json.dumps(CARD | {"trace": float("nan")}).encode(), "not JSON"),
    "number beyond float64 in a card": ("weights-card", json.dumps(CARD).encode()[:-1] + b', "a": 1e999}', "not JSON"),
    "NaN among a planner's options": ("episode", with_options(lengths=[float("nan")]), "options: holds a number"),
}


@pytest.mark.filterwarnings("ignore")  # NumPy warns of old headers
@pytest.mark.parametrize("what", FOUND)
def test_it_is_told_in_one_line(what):
    name, data, told = FOUND[what]
    target = TARGETS[name]
    with working_folder() as folder:
        assert not check(target, data, Path(folder))
        with pytest.raises(InputError) as caught:
            target.read(Path(folder) / f"input{target.suffix}")
    assert told in str(caught.value)
