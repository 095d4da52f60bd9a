"""What is fuzzed: every reader of files that people bring. To add one, put a row into `TARGETS`."""

import io
import json
import tempfile
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import jax
import numpy as np
from fuzz_check import Failure, Target
from fuzz_field_files import FIELD_FILE_TARGETS
from fuzz_journals import JOURNAL_TARGETS
from fuzz_lines import LINE_TARGETS
from fuzz_surveys import SURVEY_TARGETS

from maipp.bench.tables import PAPER, TableSpec, read_table
from maipp.engine.episode_io import read_episode, write_episode
from maipp.fields.raster_io import load_raster
from maipp.policy.network import PolicyNetwork
from maipp.policy.weights import load_weights, save_weights
from maipp.scenario import Scenario
from maipp.scenario_io import dump_scenario, load_scenario, save_scenario
from maipp.training.config import NAMED
from maipp.training.config_io import dump_config, load_config

# Readers whose answer is also written and read back: it must come back the same.


def _scenario(path: Path) -> Scenario:
    scenario = load_scenario(path)
    copy = path.with_name("copy.yaml")
    save_scenario(scenario, copy)
    again = load_scenario(copy)
    copy.unlink()
    if again != scenario:
        raise Failure(f"read back differently: {again}")
    return scenario


def _table(path: Path) -> TableSpec:
    """Its planners are not tried: they may be any code."""
    return read_table(path, check=False)


def _table_seeds() -> list[bytes]:
    own = b"columns: {threshold: [0.3, 0.4]}\nrows: [greedy, {planner: sga-rrt, options: {lengths: [0.2, 0.3]}}]\n"
    return [own, *((PAPER / f"table{number}.yaml").read_bytes() for number in (2, 4))]


def _episode(path: Path) -> Any:
    episode = read_episode(path)
    copy = path.with_name("copy.json")
    write_episode(episode, copy)
    text = copy.read_bytes()
    write_episode(read_episode(copy), copy)
    same = copy.read_bytes() == text
    copy.unlink()
    if not same:
        raise Failure("written differently the second time")
    return episode


# Good inputs

_NPY = (
    b"'<f8'",
    b"'|O'",
    b"'<U4'",
    b"'<c16'",
    b"'>i2'",
    b"'|b1'",
    b"'|V8'",
    b"'<M8[s]'",
    b"True",
    b"(4, 3)",
    b"(0, 3)",
    b"()",
)
_X, _Y = np.array([100.0, 110.0, 125.0]), np.array([-3.0, 0.0, 20.0, 47.0])
_VALUES = np.arange(12.0).reshape(4, 3) ** 1.5 - 7.0


def _raster_csv_seeds() -> list[bytes]:
    rows = [(x, y, _VALUES[j, i]) for j, y in enumerate(_Y) for i, x in enumerate(_X)]
    long = "\n".join(",".join(f"{cell:.4g}" for cell in row) for row in rows)
    matrix = "\n".join(" ".join(f"{cell:.4g}" for cell in row) for row in _VALUES.T)
    headed = f"lon,lat,depth\n{long}\n"
    texts = [headed, long, matrix, headed.replace(",", ";"), f"\ufeff# made by hand\n{headed}".replace("\n", "\r\n")]
    return [text.encode() for text in texts]


def _npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def _npz(write: Callable[..., None]) -> bytes:
    file = io.BytesIO()
    write(file, z=_VALUES, x=_X, y=_Y)
    return file.getvalue()


def _with_coordinates(member: bytes) -> bytes:
    """An .npz whose values are these bytes: the archive is whole, only what is in it is not."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in (("z", member), ("x", _npy(_X)), ("y", _npy(_Y))):
            archive.writestr(f"{name}.npy", content)
    return file.getvalue()


def _scenario_seeds() -> list[bytes]:
    full = Scenario(
        agents=2,
        budget=(2.0, 3.5),
        start=((0.1, 0.2), (0.3, 0.4)),
        comm_range=0.3,
        obstacles=(((0.1, 0.1), (0.2, 0.1), (0.2, 0.3)), ((0.5, 0.5), (0.6, 0.5), (0.6, 0.7), (0.5, 0.7))),
        field="depths.csv",
    )
    anchors = "agents: 1\nextent: &e [1.0, 1.0]\nobstacles: [[[0, 0], *e, [0, 1]]]\nbudget: 2\n"
    twice = "a0: &a [1, 1]\n" + "".join(f"a{i + 1}: &{c} [*{p}, *{p}]\n" for i, (p, c) in enumerate(_letters()))
    return [
        dump_scenario(full).encode(),
        dump_scenario(full, comments=False).encode(),
        b"agents: 3\nbudget: 2.5\nthreshold: 0.4 # mg\n",
        anchors.encode(),
        (twice + "budget: *z\n").encode(),  # a list that would have 2**26 entries
    ]


def _letters() -> list[tuple[str, str]]:
    letters = "abcdefghijklmnopqrstuvwxyz"
    return list(zip(letters, letters[1:], strict=False))


def _episode_seeds() -> list[bytes]:
    scenario = Scenario(agents=2, grid=2, budget=1.0, measurement_interval=0.5, nodes=4, neighbours=2)
    agent = {
        "start": [0.25, 0.5],
        "budget": 1.0,
        "speed": 1.0,
        "distance": 1.0,
        "decisions": 2,
        "route": {"x": [0.25, 0.75, 0.75], "y": [0.5, 0.5, 1.0], "time": [0.0, 0.5, 1.0]},
        "measurements": {"x": [0.75, 0.75], "y": [0.5, 1.0], "value": [0.125, -0.5], "time": [0.5, 1.0]},
        "known": [2, 2],
    }
    mapping = {"origin": [4.0, 51.0], "size": [2.0, 2.0], "domain": [1.0, 1.0], "value_at_zero": 3.0}
    record = {
        "schema": "maipp.episode/1",
        "precision": "float32",
        "planner": {"name": "greedy", "options": {"steps": 3, "lengths": [0.3, 0.4], "mode": "mean"}},
        "seed": 7,
        "index": 0,
        "scenario": scenario.to_dict(),
        "mapping": mapping | {"value_at_one": 9.5, "x_name": "lon", "y_name": "lat", "value_name": None},
        "metrics": {
            "trace": 2.5,
            "own_trace": [3.0, 2.75],
            "true_trace": 1.5,
            "rmse": 0.25,
            "mutual_information": 4.0,
            "curve": {"time": [0.0, 0.5, 1.0], "trace": [4.0, 3.0, 2.5]},
        },
        "message_bytes": 20,
        "agents": [agent, agent],
        "truth": [[0.0, 0.25], [0.5, 1.0]],
        "outside": [1],
    }
    return [json.dumps(record, indent=1).encode(), json.dumps(record | {"mapping": None}).encode()]


def _config_seeds() -> list[bytes]:
    return [dump_config(NAMED["default"]).encode(), b"updates: 500\nbudget: [1.0, 3.5]\nlearning_rate: 1e-4\n"]


@cache
def _weights() -> tuple[bytes, bytes]:
    """A small network's weights and their card."""
    network = PolicyNetwork(
        jax.random.key(0), width=4, heads=2, encoder_layers=1, encoding_dimensions=2, use_intent=True
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "weights.safetensors"
        save_weights(network, path, {"policy": "ti", "trace": 12.5})
        return path.read_bytes(), path.with_suffix(".json").read_bytes()


def _card(path: Path) -> Any:
    weights = path.with_suffix(".safetensors")
    weights.write_bytes(_weights()[0])
    try:
        return load_weights(weights)[1]
    finally:
        weights.unlink()


def _tensors(path: Path) -> Any:
    card = path.with_suffix(".json")
    card.write_bytes(_weights()[1])
    try:
        return load_weights(path)[1]
    finally:
        card.unlink()


_YAML = (
    b"- ",
    b": ",
    b"&a ",
    b"*a",
    b"!!python/object:os.system",
    b"!!int",
    b"!!float",
    b"|\n",
    b"---\n",
    b"? ",
    b"<<: *a",
    b"~",
)
_JSON = (b"[]", b"{}", b"null", b"true", b'"x"', b"[[]]", b"1e400", b'{"a": 1, "a": 2}')
_TABLE = tuple(
    word.encode()
    for word in "title scenario columns rows parts printed left_out metric beside reference trials worlds name".split()
)
_FIELDS = tuple(name.encode() for name in Scenario.__dataclass_fields__)

TARGETS: dict[str, Target] = {
    "raster-csv": Target(".csv", load_raster, _raster_csv_seeds, (b",", b";", b"#", b"x", b"lat", b"easting")),
    "raster-npy": Target(".npy", load_raster, lambda: [_npy(_VALUES), _npy(_VALUES.astype(np.int16).T)], _NPY),
    "raster-npz": Target(".npz", load_raster, lambda: [_npz(np.savez), _npz(np.savez_compressed)], _NPY),
    "raster-npz-member": Target(".npz", load_raster, lambda: [_npy(_VALUES)], _NPY, pack=_with_coordinates),
    "scenario": Target(".yaml", _scenario, _scenario_seeds, _YAML + _FIELDS, slice=500),
    "table": Target(".yaml", _table, _table_seeds, _YAML + _FIELDS + _TABLE, slice=300),
    "episode": Target(".json", _episode, _episode_seeds, _JSON, slice=1000),
    "training-config": Target(".yaml", load_config, _config_seeds, _YAML, slice=500),
    "weights-card": Target(".json", _card, lambda: [_weights()[1]], _JSON, slice=100),
    "weights-tensors": Target(".safetensors", _tensors, lambda: [_weights()[0]], (b"F16", b"BF16", b"I64"), slice=100),
}

TARGETS |= SURVEY_TARGETS | JOURNAL_TARGETS | FIELD_FILE_TARGETS | LINE_TARGETS
