"""The documentation site builds without a warning, needs nothing from elsewhere, and says what is so."""

import dataclasses
import functools
import importlib
import importlib.util
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"


def rows(page: str, start: str = "", end: str = "") -> list[list[str]]:
    """The cells of the rows of a page's tables between two places, heads and rulers left out."""
    text = (DOCS / page).read_text(encoding="utf-8")
    text = text[text.index(start) :] if start else text
    text = text[: text.index(end)] if end else text
    found = re.findall(r"^\|(.*)\|$\n(?!\| *-)", text, flags=re.MULTILINE)
    cells = [[cell.strip() for cell in row.split(" | ")] for row in found]
    return [row for row in cells if not set(row[0]) <= {"-", ":", " ", "|"}]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the site as `make docs` builds it."""
    pytest.importorskip("mkdocs")
    pytest.importorskip("material")
    pytest.importorskip("mkdocstrings")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


@pytest.mark.slow
def test_every_page_is_built(site):
    pages = {path.relative_to(DOCS).with_suffix(".html") for path in DOCS.rglob("*.md")}
    assert {page for page in pages if not (site / page).is_file()} == set()
    assert all((site / "project" / f"{name}.html").is_file() for name in ("readme", "contributing", "changelog"))
    assert not (site / "site").exists()  # the hooks themselves


@pytest.mark.slow
def test_nothing_is_fetched_from_elsewhere(site):
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        fetched = re.findall(r'<(?:script|img|iframe|source)\b[^>]*\bsrc="([^"]+)"', text)
        fetched += [target for target in re.findall(r'<link\b[^>]*\bhref="([^"]+)"', text)]
        assert [target for target in fetched if "//" in target] == [], page


@pytest.mark.slow
def test_links_between_pages_lead_somewhere(site):
    for page in site.rglob("*.html"):
        for target in re.findall(r'<(?:a|img)\b[^>]*\b(?:href|src)="([^"#]+)', page.read_text(encoding="utf-8")):
            if "://" not in target and not target.startswith(("mailto:", "data:")) and page.name != "404.html":
                assert (page.parent / target).exists(), f"{page.relative_to(site)}: {target}"


@pytest.mark.slow
def test_the_api_says_shapes_and_what_fields_mean(site):
    text = re.sub(r"<[^>]+>", "", (site / "api" / "engine.html").read_text(encoding="utf-8"))
    assert "odometer" in text and "Distance travelled on arrival." in text
    index = (site / "api" / "index.html").read_text(encoding="utf-8")
    import maipp

    assert all(f".{name}" in index for name in maipp.__all__ if name != "__version__")


def test_every_room_has_its_place_in_the_api():
    of_ours = {"cli", "records", "kept"}  # nothing to build on
    rooms = {path.parent.name for path in (ROOT / "src" / "maipp").glob("*/__init__.py")} - of_ours
    pages = "".join(page.read_text(encoding="utf-8") for page in (DOCS / "api").glob("*.md"))
    assert rooms - set(re.findall(r"^::: maipp\.(\w+)", pages, flags=re.MULTILINE)) == set()


@functools.cache
def hooks():
    """The module with the site's hooks."""
    pytest.importorskip("mkdocs")
    spec = importlib.util.spec_from_file_location("links", DOCS / "site" / "links.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("page", "before", "after"),
    [
        ("protocol.md", "[r](../README.md#planners)", "[r](project/readme.md#planners)"),
        ("api/index.md", "[r](../../README.md)", "[r](../project/readme.md)"),
        ("api/index.md", "[p](../planners.md#ti)", "[p](../planners.md#ti)"),
        ("project/readme.md", "![d](docs/pictures/demo.png)", "![d](../pictures/demo.png)"),
        ("project/readme.md", "[x](docs/scenario.md) [c](CONTRIBUTING.md)", "[x](../scenario.md) [c](contributing.md)"),
        ("project/readme.md", "the [licence](LICENSE)", "the licence"),
        ("planners.md", "[`x`](planners.md) `[y](z)`", "[`x`](planners.md) `[y](z)`"),
        ("planners.md", "```\n[y](../README.md)\n```\n", "```\n[y](../README.md)\n```\n"),
        ("index.md", "[a](https://arxiv.org/abs/1) [b](#units)", "[a](https://arxiv.org/abs/1) [b](#units)"),
    ],
)
def test_links_are_led_to_where_pages_are_in_the_site(page, before, after):
    class Page:
        class file:  # noqa: N801  # mkdocs names it so
            src_uri = page

    assert hooks().on_page_markdown(before, Page, None, None) == after


def test_a_link_to_nowhere_is_told(caplog):
    class Page:
        class file:  # noqa: N801
            src_uri = "index.md"

    hooks().on_page_markdown("[a](../no/such.file)", Page, None, None)
    assert "the repository has no no/such.file" in caplog.text


# The names in the table of symbols, each below maipp.


def resolve(name: str) -> object:
    """What a dotted name below maipp stands for; a field without a default is True."""
    head, *rest = name.split(".")
    value: object = importlib.import_module("maipp")
    if head == "Scenario":
        rest = [head, *rest]
    else:
        value = importlib.import_module(f"maipp.{head}")
    for part in rest:
        if inspect.ismodule(value) and not hasattr(value, part):
            value = importlib.import_module(f"{value.__name__}.{part}")
        elif dataclasses.is_dataclass(value) and part in {field.name for field in dataclasses.fields(value)}:
            value = True
        else:
            value = getattr(value, part)
    return value


SYMBOLS = rows("concepts.md", "<!-- symbols -->", "<!-- /symbols -->")


@pytest.mark.parametrize("row", SYMBOLS, ids=lambda row: row[0])
def test_symbols_have_the_names_that_the_table_gives(row):
    paper, words, code, unit = (cell.strip() for cell in row)
    names = re.findall(r"`([\w.]+)`", code)
    assert names and words
    for name in names:
        if "planners.md" not in code:
            assert resolve(name) is not None, name


def test_a_name_that_is_not_there_is_found():
    for name in ("Scenario.agent", "engine.State.speed", "belief.Believe", "nowhere.Mission"):
        with pytest.raises((AttributeError, ImportError)):
            resolve(name)


WORDS = [
    [cell.strip() for cell in line.strip("|\n").split("|")]
    for line in (DOCS / "glossary.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("| ") and not line.startswith(("| Word", "| ---"))
]


@pytest.mark.parametrize("row", WORDS, ids=lambda row: row[0])
def test_words_have_the_names_that_the_glossary_gives(row):
    import maipp

    _, _, code, meaning = row
    names = re.findall(r"`([\w.]+)`", code)
    assert meaning and (names or "](" in code)
    for name in names:
        head, _, rest = name.partition(".")
        public = getattr(maipp, head) if head in maipp.__all__ else None
        if public is None:
            assert resolve(name) is not None
        elif rest:
            assert rest in {field.name for field in dataclasses.fields(public)} | set(dir(public)), name


def test_the_glossary_is_in_alphabetical_order():
    words = [row[0].lower() for row in WORDS]
    assert words == sorted(words) and len(words) > 20


# What the page on PettingZoo says of options and columns.


def test_options_of_the_environments_are_those_of_the_page():
    pytest.importorskip("pettingzoo")
    from maipp.adapters.pettingzoo import SurveyAEC, SurveyParallel

    told = {row[0].strip("`"): row[1].strip("`") for row in rows("pettingzoo.md", "## Options", "Tr(P) is that")}
    for kind in (SurveyAEC, SurveyParallel):
        parameters = dict(inspect.signature(kind.__init__).parameters)
        options = {name: str(p.default) for name, p in parameters.items() if name not in ("self", "scenario")}
        assert options == told


def test_columns_and_bounds_are_those_of_the_page():
    from maipp import Scenario
    from maipp.environments import form

    scenario = Scenario(agents=2, budget=2.5)
    table = rows("pettingzoo.md", "| Block | Column", "| Entry of the graph")
    words = {"budget": 2.5, "diagonal": 2**0.5, "prior's": 1.0, "prior's variance": 1.0}
    blocks: dict[str, form.Block] = dict(zip(("own", "team", "candidates"), form.blocks(scenario), strict=True))
    assert set(blocks) == {row[0] for row in table}
    for block, columns in (("own", form.OWN), ("team", form.TEAM), ("candidates", form.CANDIDATE)):
        told = [row for row in table if row[0] == block]
        assert tuple(row[1].strip("`") for row in told) == columns
        bounds = [[float(words.get(word, word)) for word in row[2].split(", ")] for row in told]
        low, high = (side.reshape(-1, len(columns))[0] for side in blocks[block])
        assert [[round(float(x), 5) for x in pair] for pair in zip(low, high, strict=True)] == [
            [round(x, 5) for x in pair] for pair in bounds
        ]
