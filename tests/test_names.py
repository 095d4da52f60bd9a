"""One meaning for every name: which classes and files of the package are called alike.

Only the source is read, nothing is imported.
"""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "maipp"

# How many files may have one name, each in a room of its own.
MOST_FILES = 2


def sources(package: Path) -> list[Path]:
    return sorted(package.rglob("*.py"))


def ambiguous_classes(package: Path) -> list[str]:
    """A line for every class name that two modules define; a leading underscore makes no other name."""
    found: dict[str, list[str]] = {}
    for path in sources(package):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name.lstrip("_"), []).append(path.relative_to(package).as_posix())
    return [f"{name}: {', '.join(paths)}" for name, paths in sorted(found.items()) if len(paths) > 1]


def crowded_file_names(package: Path) -> list[str]:
    """A line for every file name that more than `MOST_FILES` rooms have."""
    found: dict[str, list[str]] = {}
    for path in sources(package):
        if not path.name.startswith("__"):
            found.setdefault(path.name, []).append(path.relative_to(package).as_posix())
    return [f"{name}: {', '.join(paths)}" for name, paths in sorted(found.items()) if len(paths) > MOST_FILES]


def test_a_class_name_has_one_meaning():
    assert ambiguous_classes(PACKAGE) == []


def test_a_file_name_says_what_is_in_the_file():
    assert crowded_file_names(PACKAGE) == []


# The rules must be able to fail.


def build(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("other", "alike"),
    [("class Robot: ...", True), ("class _Robot: ...", True), ("class Robots: ...", False), ("Robot = 1", False)],
)
def test_classes_called_alike_are_found(tmp_path, other, alike):
    package = build(tmp_path, {"live/robots.py": "class Robot: ...", "fleet/robot.py": other})
    assert ambiguous_classes(package) == (["Robot: fleet/robot.py, live/robots.py"] if alike else [])


def test_file_names_of_many_rooms_are_found(tmp_path):
    package = build(tmp_path, {f"{room}/survey.py": "" for room in ("cli", "live")} | {"a/__init__.py": ""})
    assert crowded_file_names(package) == []
    build(tmp_path, {"surveys/survey.py": ""})
    assert crowded_file_names(package) == ["survey.py: cli/survey.py, live/survey.py, surveys/survey.py"]
