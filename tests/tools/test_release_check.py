"""The version stands the same everywhere, and a wheel that lacks a file is found."""

from pathlib import Path

from tests.tools.release_check import cited, missing, newest, version, wrong_versions

ROOT = Path(__file__).parents[2]


def test_the_version_stands_the_same_everywhere():
    texts = [(ROOT / name).read_text(encoding="utf-8") for name in ("CHANGELOG.md", "CITATION.cff")]
    assert wrong_versions(version(), *texts) == []


def test_a_version_that_was_forgotten_is_found():
    changelog, citation = (
        "# Changelog\n\n## Unreleased\n\n## 0.3.0\n\n## 0.2.0\n",
        "cff-version: 1.2.0\nversion: 0.2.0\n",
    )
    assert newest(changelog) == "0.3.0" and cited(citation) == "0.2.0"
    assert wrong_versions("0.3.0", changelog, citation) == ["CITATION.cff has version 0.2.0, pyproject.toml 0.3.0"]
    assert len(wrong_versions("0.4.0", "# Changelog\n", "")) == 2


def test_a_file_that_a_wheel_lacks_is_named():
    assert missing(["maipp/a.py", "maipp-1.dist-info/RECORD"], ["maipp/a.py", "maipp/w.json"]) == ["maipp/w.json"]


def test_the_citation_is_read_as_yaml():
    import yaml

    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors", "version", "license"} <= set(citation)
