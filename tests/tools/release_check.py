"""Whether the wheel that would be released works where nothing else is: `make release-check`.

The wheel is built from this checkout, installed into an empty environment with neither extras nor development tools,
and used from an empty folder. Every file of the package that git knows must be in it.
"""

import re
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[2]

# What an installed wheel is asked to do: each with words that its output or its files must have.
TINY = "--agents 2 --budget 0.6 --set scenario.grid=8 scenario.nodes=12 scenario.neighbours=4"
COMMANDS = (
    "maipp --version",
    "maipp planners",
    "maipp scenario",
    f"maipp plan --planner intent-paths {TINY} --no-animation --out plan",  # with the weights that ship
    f"maipp evaluate random greedy {TINY} --instances 2 --trials 2 --no-timing",
    "maipp survey --new mission.yaml",
    "maipp demo --out demo --planner greedy",
)
FILES = ("plan/episode.json", "plan/waypoints.csv", "plan/overview.png", "mission.yaml", "demo/episode.json")


def version() -> str:
    """The version that pyproject.toml gives."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]


def newest(changelog: str) -> str:
    """The newest version that a changelog tells of; what is not released yet has none."""
    found = re.search(r"^## (\d\S*)", changelog, flags=re.MULTILINE)
    return found[1] if found else "none"


def cited(citation: str) -> str:
    """The version in a CITATION.cff."""
    found = re.search(r"^version: (\S+)$", citation, flags=re.MULTILINE)
    return found[1] if found else "none"


def wrong_versions(project: str, changelog: str, citation: str) -> list[str]:
    """Where the version stands otherwise than in pyproject.toml."""
    told = {"CHANGELOG.md": newest(changelog), "CITATION.cff": cited(citation)}
    return [f"{name} has version {given}, pyproject.toml {project}" for name, given in told.items() if given != project]


def missing(names: Iterable[str], tracked: Iterable[str]) -> list[str]:
    """Files of the package, as paths below src/, that a wheel with these names lacks."""
    return sorted(set(tracked) - set(names))


def main() -> int:
    """Build, install, use; 1 and a line for whatever is not as it must be."""
    texts = [(ROOT / name).read_text(encoding="utf-8") for name in ("CHANGELOG.md", "CITATION.cff")]
    problems = wrong_versions(version(), *texts)
    with tempfile.TemporaryDirectory(prefix="release-check-") as made:
        folder = Path(made)
        wheel = _built(folder / "wheels")
        problems += [f"{wheel.name} lacks {name}" for name in missing(zipfile.ZipFile(wheel).namelist(), _tracked())]
        problems += _used(wheel, folder)
    for problem in problems:
        print(f"release-check: {problem}", file=sys.stderr)
    print(f"{wheel.name}: {'not fit' if problems else 'fit'} for a release")
    return int(bool(problems))


def _built(folder: Path) -> Path:
    command = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", "wheel"]
    subprocess.run([*command, "--no-deps", "--no-build-isolation", "--wheel-dir", folder, ROOT], check=True)
    (wheel,) = folder.glob("*.whl")
    return wheel


def _tracked() -> list[str]:
    done = subprocess.run(["git", "ls-files", "src/maipp"], cwd=ROOT, check=True, capture_output=True, text=True)
    return [line.removeprefix("src/") for line in done.stdout.splitlines()]


def _used(wheel: Path, folder: Path) -> list[str]:
    """What goes wrong with the wheel in an environment of its own."""
    environment, work = folder / "environment", folder / "work"
    work.mkdir()
    subprocess.run([sys.executable, "-m", "venv", environment], check=True)
    pip = [environment / "bin" / "python", "-m", "pip", "--quiet", "--disable-pip-version-check", "install"]
    subprocess.run([*pip, "--constraint", ROOT / "constraints.txt", wheel], check=True)
    problems = []
    for line in COMMANDS:
        program, *arguments = line.split()
        # No other variables: what the checkout's own environment points at must not help.
        done = subprocess.run(
            [environment / "bin" / program, *arguments],
            cwd=work,
            env={"HOME": str(folder), "PATH": "/usr/bin:/bin", "JAX_PLATFORMS": "cpu"},
            capture_output=True,
            text=True,
        )
        print(f"{'ok    ' if done.returncode == 0 else 'FAILED'} {line}")
        if done.returncode:
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            problems.append(f"{line}: exit code {done.returncode}: {last}")
        if line == "maipp --version" and done.stdout.strip() != f"maipp {version()}":
            problems.append(f"{line} prints {done.stdout.strip()!r}")
    return problems + [f"{name} was not written" for name in FILES if not (work / name).is_file()]


if __name__ == "__main__":
    sys.exit(main())
