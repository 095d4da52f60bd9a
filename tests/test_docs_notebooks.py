"""The notebooks in docs/notebooks run from the first cell to the last, are saved without outputs, and link to pages."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
NEEDS = {"reinforcement-learning": "pettingzoo", "field-survey": "rasterio"}


def cells(path: Path, kind: str) -> list[dict[str, Any]]:
    """The cells of one kind."""
    return [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == kind]


def text(cell: dict[str, Any]) -> str:
    """What a cell says."""
    return "".join(cell["source"])


def test_there_is_one_for_each_kind_of_reader():
    assert {path.stem for path in NOTEBOOKS} == set(NEEDS)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_no_outputs_are_kept(path):
    assert cells(path, "code")
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells(path, "code"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_links_lead_to_pages(path):
    targets = [target for cell in cells(path, "markdown") for target in re.findall(r"\]\(([^)]+)\)", text(cell))]
    assert all(target.startswith("https://") or (FOLDER / target.partition("#")[0]).is_file() for target in targets)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs(path, tmp_path, monkeypatch, capsys):
    pytest.importorskip(NEEDS[path.stem])
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    monkeypatch.chdir(tmp_path)  # what it writes must not land in the checkout
    names: dict[str, object] = {}
    for number, cell in enumerate(cells(path, "code"), start=1):
        exec(compile(text(cell), f"{path.name}, code cell {number}", "exec"), names)
    assert "nan" not in capsys.readouterr().out
