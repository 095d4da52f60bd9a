"""Pages of results: frames as tables; the report, whose places are filled, words around them stay, files come along."""

import pandas as pd
import pytest

from maipp.bench import page as page_module
from maipp.bench.page import markdown, write_report
from maipp.errors import InputError

PAGE = """Words.

<!-- table1:start -->
old
<!-- table1:end -->

More.

<!-- latency:start -->
<!-- latency:end -->
"""


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "docs" / "results.md"
    path.parent.mkdir()
    path.write_text(PAGE, encoding="utf-8")
    return path


@pytest.fixture
def run(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    text = "| 1 |\n\n![T](table1.png)\n\n[table1.csv.gz](table1.csv.gz), [paper](https://arxiv.org/abs/2303.05351)\n"
    (folder / "table1.md").write_text(text, encoding="utf-8")
    (folder / "table1.png").write_bytes(b"picture")
    (folder / "table1.csv.gz").write_bytes(b"numbers")
    return folder


def test_a_place_is_filled_and_the_rest_stays(page, run):
    written = write_report(page, [run])
    text = page.read_text(encoding="utf-8")
    assert text.startswith("Words.\n\n<!-- table1:start -->\n\n| 1 |\n") and "old" not in text
    assert text.endswith("More.\n\n<!-- latency:start -->\n<!-- latency:end -->\n")
    assert "![T](results/table1.png)" in text and "(https://arxiv.org/abs/2303.05351)" in text
    assert (page.parent / "results" / "table1.png").read_bytes() == b"picture"
    assert (page.parent / "results" / "table1.csv.gz").read_bytes() == b"numbers"
    assert written.places == ("table1",) and len(written.files) == 2


def test_again_is_the_same(page, run):
    write_report(page, [run])
    once = page.read_bytes()
    write_report(page, [run])
    assert page.read_bytes() == once


def test_a_second_run_fills_its_own_place(page, run, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    (other / "latency.md").write_text("fast\n", encoding="utf-8")
    write_report(page, [run])
    write_report(page, [other])
    text = page.read_text(encoding="utf-8")
    assert "<!-- latency:start -->\n\nfast\n\n<!-- latency:end -->" in text and "| 1 |" in text


def test_what_is_wrong_is_told_and_nothing_written(page, run, tmp_path, monkeypatch):
    def refused(match, *runs, to=page):
        with pytest.raises(InputError, match=match):
            write_report(to, list(runs))
        assert page.read_text(encoding="utf-8") == PAGE and not (page.parent / "results").exists()

    (tmp_path / "empty").mkdir()
    refused("holds no results", tmp_path / "empty")
    refused("cannot be read", run, to=tmp_path / "none.md")
    refused("table1: is in .* and in", run, run)
    with monkeypatch.context() as patch:
        patch.setattr(page_module, "MOST_BYTES", 6)
        refused("7 bytes of raw numbers", run)
    (run / "other.md").write_text("x\n", encoding="utf-8")
    refused("no place for .*other.md; add the lines <!-- other:start -->", run)
    (run / "other.md").unlink()
    (run / "table1.png").unlink()
    refused("links to table1.png, which is not there", run)


def test_a_frame_is_a_table_of_the_columns_asked_for():
    frame = pd.DataFrame({"name": ["a", "b"], "ms": [1.25, 20.0], "left_out": [0, 0]})
    text = markdown(frame, {"row": "`{name}`", "time, ms": "{ms:.1f}"})
    assert text.splitlines() == ["| row | time, ms |", "| --- | ---: |", "| `a` | 1.2 |", "| `b` | 20.0 |"]
    twice = pd.DataFrame([["x", "1", "2"]], columns=["row", "B = 2", "B = 2"])
    assert markdown(twice).splitlines()[::2] == ["| row | B = 2 | B = 2 |", "| x | 1 | 2 |"]
