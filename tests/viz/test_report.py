"""The report's file: whole, within its size, self-contained, and safe whatever the names are."""

import dataclasses
import html
import json
import re
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from maipp.engine.episode_io import write_episode
from maipp.errors import InputError
from maipp.geo import GeoReference
from maipp.viz.report import SurveyReport, report_html, write_report

pytest.importorskip("plotly")

NASTY = (
    '<!-- <script </script ></script><img src=x onerror="alert(1)">&amp; %{x} ünï \u2028 \u202e 海 \ud800 \x00 {a} \\ `'
)


class Page(HTMLParser):
    """What a page holds: its elements, the text of the table's rows, and the bodies of its scripts."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.scripts, self.rows, self.words = [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag == "script":
            self.scripts.append("")
        elif tag == "tr":
            self.rows.append([])

    def handle_data(self, data):
        if self.elements and self.elements[-1][0] == "script" and data.strip():
            self.scripts[-1] += data
        elif data.strip():
            self.words.append(data.strip())
            if self.rows:
                self.rows[-1].append(data.strip())

    @property
    def data(self):
        return json.loads(self.scripts[0])


@pytest.fixture(scope="module")
def page(episode):
    report = SurveyReport(
        episode,
        title="Lake survey",
        date="2026-05-01",
        names=("Ada", "Bo"),
        reference=GeoReference(
            (0.0, 0.0), (1.0, 0.5), (1.0, 0.5), 5.0, 15.0, value_name="chlorophyll (µg/L)", metres_per_unit=1000.0
        ),
        seconds_per_time=1800.0,
        prior_x=np.array([[0.2, 0.1]]),
        prior_y=np.array([7.0]),
        warnings=("no earlier samples: the length scale is a guess",),
        summary=("All <came> home.",),
        homes=("yes", "no, 20 m away"),
        kept_out=(("sample", "why"), ("b-3", "<spike>")),
    )
    return Page(report_html(report))


def test_the_header_tells_who_planned_what_and_when(page, episode):
    words = " | ".join(page.words)
    for part in (
        "Lake survey",
        "2026-05-01",
        "by-hand",
        "chlorophyll (µg/L)",
        "chlorophyll ≥ 9 µg/L",
        "Seed | 0",
        "maipp ",
    ):
        assert part in words
    assert "200 m" in words  # between two measurements
    assert "no earlier samples: the length scale is a guess" in words


def test_the_key_numbers_are_the_record_s(page, episode):
    words, metrics = " | ".join(page.words), episode.metrics
    assert f"Tr(P) {metrics.trace:.3g}"[:9] in words
    assert f"{10 * metrics.rmse:.2f} µg/L | RMSE" in words
    assert f"{1000 * episode.distance:,.0f}".replace(",", "\u202f") + " m | by the team, in " in words
    count = sum(len(agent.measurement_y) for agent in episode.agents)
    assert f"Measurements | {count} | after {episode.decisions} decisions, besides 1 earlier sample" in words


def test_the_table_has_a_row_for_every_robot_in_metres_and_minutes(page, episode):
    head, *rows = page.rows
    assert head[0] == "Robot" and "Travelled (m)" in head and "Time (min)" in head
    assert [row[0] for row in rows[:2]] == ["Ada", "Bo"]
    for row, agent in zip(rows, episode.agents, strict=False):
        cells = dict(zip(head, row, strict=False))
        assert cells["Start (x, y)"] == "0.100, 0.100"
        assert float(cells["Budget (m)"]) == 800
        assert float(cells["Travelled (m)"]) == pytest.approx(1000 * agent.distance, abs=0.5)
        assert float(cells["Time (min)"]) == pytest.approx(30 * agent.route_time[-1], abs=0.06)
        assert int(cells["Measurements"]) == len(agent.measurement_y)
        assert int(cells["Decisions"]) == agent.decisions


def test_the_result_of_a_survey_is_told(page):
    head, one, two, *others = page.rows
    assert [row[head.index("Came home")] for row in (one, two)] == ["yes", "no, 20 m away"]
    assert others[0] == ["sample", "why"] and others[1][:2] == ["b-3", "<spike>"]
    assert "All <came> home." in page.words and "Samples that do not count" in page.words
    assert sum("Uncertainty left, Tr(P)" in words for words in page.words) == 1


def test_homes_are_one_per_robot(episode):
    with pytest.raises(InputError, match="homes: 1 for 2 robots"):
        SurveyReport(episode, homes=("yes",))


def test_nothing_is_loaded_from_elsewhere(page):
    for tag, attributes in page.elements:
        for name in ("src", "href", "srcset", "data", "action"):
            assert attributes.get(name, "data:,").startswith("data:"), (tag, attributes)
    policy = next(a["content"] for _, a in page.elements if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'") and "http" not in policy
    style = next(text for text in page.words if "--accent" in text)
    assert "@import" not in style and "url(" not in style and "@font-face" not in style
    assert len(page.scripts) == 3


def test_names_can_hold_anything(episode):
    there = dataclasses.replace(episode.geo, x_name=NASTY, value_name=f"{NASTY} ({NASTY})")
    told = {"summary": (NASTY,), "homes": (NASTY, "yes"), "kept_out": ((NASTY,), (NASTY,))}
    report = SurveyReport(episode, title=NASTY, names=(NASTY, "b"), reference=there, warnings=(NASTY,), **told)
    text = report_html(report)
    found = Page(text)
    assert found.data["robots"][0]["name"] == NASTY
    assert not set("<>&") & set(found.scripts[0]) and found.scripts[0].isascii()
    assert len(found.scripts) == 3 and all(tag != "img" for tag, _ in found.elements)
    clean = NASTY.replace("\ud800", "\ufffd").replace("\x00", "\ufffd")
    assert html.escape(clean) in text
    text.encode("utf-8")


def test_the_file_is_small_even_for_a_fine_grid_and_a_large_team(episode):
    scenario = episode.scenario.replace(agents=10, grid=90, budget=0.8)
    agents = tuple(dataclasses.replace(a, known=np.zeros(10, int)) for a in episode.agents * 5)
    rng = np.random.default_rng(0)
    fine = dataclasses.replace(
        episode,
        scenario=scenario,
        agents=agents,
        truth=rng.normal(size=8100).astype(np.float32),
        inside=np.ones(8100, bool),
        recorded=episode.metrics,
    )
    assert len(report_html(SurveyReport(fine)).encode()) < 8_000_000


def test_the_file_is_written_whole_or_not_at_all(episode, tmp_path):
    write_report(tmp_path / "report.html", SurveyReport(episode))
    content = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert content.startswith("<!DOCTYPE html>") and content.rstrip().endswith("</html>")
    with pytest.raises(InputError, match="cannot be written"):
        write_report(tmp_path / "missing" / "report.html", SurveyReport(episode))
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_without_plotly_the_person_is_told_what_to_install(episode, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    with pytest.raises(InputError, match=r"needs plotly: pip install 'maipp\[geo\]'"):
        write_report(tmp_path / "report.html", SurveyReport(episode))
    assert list(tmp_path.iterdir()) == []


def section():
    """What docs/episode.md says of the report."""
    page = (Path(__file__).parents[2] / "docs" / "episode.md").read_text(encoding="utf-8")
    return page.partition("## The report\n")[2].partition("\n## ")[0]


def test_every_fact_is_documented():
    facts = {field.name for field in dataclasses.fields(SurveyReport)} - {"episode"}
    told = set(re.findall(r"`(\w+)|^    (\w+)=", section(), flags=re.MULTILINE))  # in words, or in the example
    assert facts - {name for pair in told for name in pair} == set()


def test_the_example_on_the_page_runs(episode, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out" / "plan").mkdir(parents=True)
    counts = np.array([len(agent.measurement_y) for agent in episode.agents])
    agents = tuple(dataclasses.replace(agent, known=counts) for agent in episode.agents)
    write_episode(dataclasses.replace(episode, agents=agents), tmp_path / "out" / "plan" / "episode.json")
    (example,) = re.findall(r"```python\n(.*?)```", section(), flags=re.DOTALL)
    exec(compile(example.replace('"Bo", "Cy"', '"Bo"'), "episode.md", "exec"), {})
    page = Page((tmp_path / "out" / "plan" / "report.html").read_text(encoding="utf-8"))
    assert page.data["axes"]["shown"][0] < 2600 < 3400 < page.data["axes"]["shown"][2]
    assert "chlorophyll ≥ 8 µg/L" in page.words
