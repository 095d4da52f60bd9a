"""The pages of measurements say what the data beside them say, and no other page has measurements of its own."""

import re

import pytest

from maipp.errors import InputError
from tests.tools import evidence

PAGES = evidence.pages()
# A value with its standard error, such as 7.6 (0.4) or 7.6 ± 0.4.
MEASURED = re.compile(r"\d \(\d[\d.,]*\)|\d ± \d")


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(evidence.DOCS)))
def test_pages_are_written_from_the_data(path):
    assert path.read_text(encoding="utf-8") == PAGES[path], "run: python -m tests.tools.evidence"


def test_every_file_of_numbers_has_its_page_and_every_choice_a_page():
    assert evidence.names()
    assert all((evidence.EVIDENCE / f"{name}.md").is_file() for name in evidence.names())
    assert {choice.page for choice in evidence.decisions()} <= set(evidence.names())
    assert all(choice.tried and choice.effect and choice.decision for choice in evidence.decisions())


def test_links_to_sections_lead_somewhere():
    for page, title in re.findall(r"\]\((\w+)\.md#([\w-]+)\)", evidence.choices_body()):
        text = (evidence.EVIDENCE / f"{page}.md").read_text(encoding="utf-8")
        assert title in {evidence.anchor(heading) for heading in re.findall(r"^## (.*)$", text, flags=re.MULTILINE)}


def by_hand(text: str) -> str:
    """A page without code and without what stands between markers, which commands write."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"<!-- ([\w ]+)(:start)? -->.*?<!-- (/\1|\1:end) -->", "", text, flags=re.DOTALL)


@pytest.mark.parametrize("path", sorted(evidence.DOCS.glob("*.md")), ids=lambda path: path.name)
def test_other_pages_have_no_measurements_of_their_own(path):
    assert MEASURED.findall(by_hand(path.read_text(encoding="utf-8"))) == []


def test_a_measurement_by_hand_is_found():
    assert MEASURED.findall("ends with Tr(P) = 7.6 (0.4)") and MEASURED.findall("7.6 ± 0.4")
    assert by_hand("a <!-- x -->7.6 (0.4)<!-- /x --> b <!-- y:start -->7 ± 1<!-- y:end --> c") == "a  b  c"


HEAD = "section,what,measure,at,value,se,n,seed,machine,commit,date,command\n"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a,b\n", "its columns are not section,what"),
        (HEAD + "s,w,m,B = 2,7.6\n", "5 cells; give 12"),
        (HEAD + "s,w,m,B = 2,about 7,,,,,,,\n", "row 2: value 'about 7'"),
        (HEAD + "s,w,m,B = 2,nan,,,,,,,\n", "a finite value"),
        (HEAD + "s,w,m,B = 2,7.6,-1,,,,,,\n", "an se >= 0"),
    ],
)
def test_data_that_make_no_page_are_told(text, complaint, tmp_path):
    (tmp_path / "x.csv").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(complaint)):
        evidence.measurements("x", tmp_path)


def rows(*values: tuple[str, str, str, str]) -> list[evidence.Measured]:
    """Rows of one section, of (what, at, value, se)."""
    return [
        evidence.Measured("s", what, "difference of Tr(P)", at, value, se, "30 x 1", seed, "", "", "", "")
        for (what, at, value, se), seed in zip(values, "0770", strict=False)
    ]


def test_a_table_has_a_column_for_each_place_and_for_what_the_rows_do_not_share():
    table = evidence._table(rows(("a", "B = 3", "1.5", "0.2"), ("b", "B = 2", "-2", "")))
    assert table.splitlines() == [
        "|  | B = 2 | B = 3 | seed |",
        "| --- | ---: | ---: | ---: |",
        "| a |  | +1.5 (0.2) | 0 |",
        "| b | -2 |  | 7 |",
    ]


def test_a_number_that_stands_there_twice_is_told():
    with pytest.raises(InputError, match="stands there twice"):
        evidence._table(rows(("a", "B = 2", "1", ""), ("b", "B = 2", "1", ""), ("b", "B = 2", "2", "")))


def test_means_are_over_worlds_of_the_means_over_trials(monkeypatch, tmp_path):
    import gzip

    (tmp_path / "tables").mkdir()
    lines = ["row,range,budget,instance,trial,trace"]
    lines += [f"x,,2,{world},{trial},{value}" for world, trial, value in [(0, 0, 1), (0, 1, 3), (1, 0, 4)]]
    with gzip.open(tmp_path / "tables" / "t.csv.gz", "wt") as file:
        file.write("\n".join(lines))
    monkeypatch.setattr(evidence, "EVIDENCE", tmp_path)
    mean = evidence.table_means("t")["x", "", "2"]
    assert (mean.mean, round(mean.se, 9)) == (3.0, 1.0) and str(mean) == "3.0 ± 1.0"
