"""Scenario files: what is written is read back, and errors name file, line and key."""

import os
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.records import fields_of
from maipp.scenario import Scenario
from maipp.scenario_io import (
    dump_scenario,
    load_scenario,
    parse_scenario,
    save_scenario,
    with_field_table,
)

PAGE = Path(__file__).parents[1] / "docs" / "scenario.md"

lengths = st.floats(1e-3, 1e3)
positions = st.tuples(st.floats(0, 1), st.floats(0, 1))
polygons = st.lists(st.tuples(lengths, lengths), min_size=3, max_size=5, unique=True).map(tuple)
# Whatever a file may be called, not least what YAML would take for something else.
paths = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1) | st.sampled_from(
    [
        "null",
        "~",
        "true",
        "no",
        "1e-6",
        "3",
        ".inf",
        "2020-01-01",
        "- x",
        "a: b",
        "# x",
        " x ",
        "1:30",
        "a\nb",
        "'",
    ]
)


@st.composite
def fields(draw):
    # Not the scenario itself: the tests' runtime type checker draws random numbers, which no strategy may.
    agents = draw(st.integers(1, 4))

    def shared_or_own(each):
        return draw(each | st.tuples(*[each] * agents))

    nodes = draw(st.integers(2, 500))
    budget = shared_or_own(lengths)
    longest = max(budget) if isinstance(budget, tuple) else budget
    return dict(
        agents=agents,
        budget=budget,
        speed=shared_or_own(lengths),
        start=draw(st.none() | positions | st.tuples(*[positions] * agents)),
        comm_range=draw(st.none() | lengths),
        measurement_interval=longest * draw(st.floats(1e-3, 1)),
        extent=draw(st.tuples(st.floats(1, 9), st.floats(1, 9))),
        grid=draw(st.integers(2, 99)),
        obstacles=tuple(draw(st.lists(polygons, max_size=2))),
        field=draw(st.none() | paths),
        mixture_components=draw(st.lists(st.integers(1, 50), min_size=2, max_size=2).map(sorted)),
        mixture_variance=draw(st.lists(st.floats(1e-30, 1), min_size=2, max_size=2).map(sorted)),
        length_scale=draw(lengths),
        signal_variance=draw(st.floats(1e-30, 1e30)),
        noise=draw(st.floats(0, 1)),
        belief_capacity=draw(st.integers(1, 10**6)),
        threshold=draw(st.floats(-1e30, 1e30)),
        beta=draw(st.floats(0, 1e30)),
        interest_rule=draw(st.sampled_from(["std", "variance"])),
        virtual_value=draw(st.sampled_from(["mean", "zero"])),
        nodes=nodes,
        neighbours=draw(st.integers(1, nodes - 1)),
    )


@pytest.mark.parametrize("name", ["\x85", "a\u2028b", "\u2029", "a\nb", " a ", "'", '"'])
def test_odd_file_names_survive(name):
    assert parse_scenario(dump_scenario(Scenario(field=name))).field == name


@given(fields(), st.booleans())
def test_what_is_written_is_what_is_read(values, comments):
    scenario = Scenario(**values)
    assert parse_scenario(dump_scenario(scenario, comments=comments)) == scenario


@given(fields())
def test_other_yaml_readers_read_the_same_numbers(values):
    # PyYAML by itself follows YAML 1.1, under which only 1.0e-06 is a number and 1e-06 is text.
    scenario = Scenario(**values).replace(field=None)
    assert yaml.safe_load(dump_scenario(scenario)) == scenario.to_dict()


def test_every_key_stands_below_its_comment():
    lines = dump_scenario(Scenario()).splitlines()
    comment = ""
    for row in fields_of(Scenario):
        at = next(number for number, line in enumerate(lines) if line.startswith(f"{row.name}:"))
        first = max((n for n in range(at) if not lines[n].startswith("#")), default=-1) + 1
        comment = " ".join(line.removeprefix("# ") for line in lines[first:at])
        assert row.meaning[1:] in comment and f"[{row.about['unit']}]" in comment and row.allowed in comment
    assert max(map(len, lines)) <= 100
    assert "#" not in dump_scenario(Scenario(), comments=False)


def test_the_dump_reads_as_a_person_would_write_it():
    scenario = Scenario.create(
        start=[[0, 0.5], [1, 0.5], [0, 0]], obstacles=[[[0, 0], [1, 0], [0, 1]]], field="a b.npy"
    )
    text = dump_scenario(scenario, comments=False)
    assert "agents: 3\nbudget: 3.0\n" in text
    assert "start:\n- [0.0, 0.5]\n- [1.0, 0.5]\n- [0.0, 0.0]\nend: null\nreserve: 0.0\ncomm_range: null\n" in text
    assert "obstacles:\n- - [0.0, 0.0]\n  - [1.0, 0.0]\n  - [0.0, 1.0]\nfield: a b.npy\n" in text
    assert "mixture_components: [8, 12]\n" in text and "noise: 1.0e-06\n" in text


@pytest.mark.parametrize("text", ["1e-6", "1E-6", "1.e-6", "+1.0e-06", "0.000001", ".1e-5", "!!float 1e-6"])
def test_every_way_to_write_a_number_is_read_as_one(text):
    assert parse_scenario(f"noise: {text}").noise == 1e-6


def test_whole_numbers_are_decimal():
    assert parse_scenario("agents: 010").agents == 10


def test_keys_left_out_keep_their_defaults(tmp_path):
    file = tmp_path / "survey.yaml"
    file.write_bytes(b"\xef\xbb\xbf# a survey\r\nagents: 2\r\nbudget: [1, 2.5]\r\n")
    assert load_scenario(file) == Scenario(agents=2, budget=(1, 2.5))
    assert parse_scenario("{}") == Scenario()


WRONG = {
    "empty": ("", r"^s\.yaml: empty file; `maipp scenario` prints a full one"),
    "only comments": ("# agents: 3\n", r"^s\.yaml: empty file"),
    "only a marker": ("---\n", r"^s\.yaml: empty file"),
    "list": ("# x\n- agents", r"^s\.yaml:2: not a mapping"),
    "word": ("agents", r"^s\.yaml:1: not a mapping"),
    "wrong value": (
        "agents: 2\n\nbudget: -1.0\n",
        r"^s\.yaml:3: budget: -1\.0 is not a length > 0",
    ),
    "wrong element": (
        "agents: 2\nbudget:\n- 1\n- no\n",
        r"^s\.yaml:2: budget\[1\]: 'no' does not fit; give a length > 0",
    ),
    "text for a number": ('agents: "3"', r"^s\.yaml:1: agents: '3' is not a whole number >= 1"),
    "nothing": ("agents: 2\nbudget:\n", r"^s\.yaml:2: budget: None is not a length > 0"),
    "true": ("agents: true", r"^s\.yaml:1: agents: True is not a whole number >= 1"),
    "infinite": ("budget: .inf", r"^s\.yaml:1: budget: inf is not a length > 0"),
    "minus infinite": ("threshold: -.INF", r"^s\.yaml:1: threshold: -inf is not a finite number"),
    "not a number": ("threshold: .nan", r"^s\.yaml:1: threshold: nan is not a finite number"),
    "overflow": ("budget: 1e999", r"^s\.yaml:1: budget: inf is not a length > 0"),
    "sexagesimal": ("agents: 1:30", r"^s\.yaml:1: agents: '1:30' is not a whole number"),
    "mapping for a number": ("budget: {a: 1}", r"^s\.yaml:1: budget: \{'a': 1\} is not a length > 0"),
    "default against given": ("nodes: 10\n", r"^s\.yaml: neighbours: 20 is not below nodes \(10\)"),
    "unknown": ("agents: 2\nbugdet: 3", r"^s\.yaml:2: bugdet: no such key; did you mean budget\?$"),
    "unknown number": ("3: 3", r"^s\.yaml:1: 3: no such key; there are agents, budget"),
    "twice": (
        "agents: 2\nbudget: 1\nagents: 3",
        r"^s\.yaml:3: agents: given twice, first on line 1; keep one$",
    ),
    "twice, unknown": ("a: 2\na: 3", r"^s\.yaml:2: a: given twice"),
    "list as key": ("? [a]\n: 3", r"^s\.yaml:1: the key is not a plain word"),
    "broken": ("agents: 2\nbudget: [1, 2\n", r"^s\.yaml:3: not valid YAML: "),
    "two colons": ("agents: 2: 3", r"^s\.yaml:1: not valid YAML: mapping values are not allowed here$"),
    "tab": ("agents: 2\n\tbudget: 1", r"^s\.yaml:2: not valid YAML: "),
    "control character": ("agents: 2\nfield: \x07", r"^s\.yaml:2: not valid YAML: special characters"),
    "two documents": ("agents: 2\n---\nagents: 3", r"^s\.yaml:2: not valid YAML: "),
    "unknown anchor": ("agents: *m", r"^s\.yaml:1: not valid YAML: found undefined alias"),
    "itself": ("budget: &a [*a]", r"^s\.yaml:1: not valid YAML: "),
    "Python object": ("agents: !!python/name:os.system", r"^s\.yaml:1: not valid YAML: could not determine"),
    "false tag": ("agents: !!int three", r"^s\.yaml:1: agents: cannot be read"),
    "false bool": ("agents: !!bool perhaps", r"^s\.yaml:1: agents: cannot be read"),
    "date": ("field: !!timestamp x", r"^s\.yaml:1: not valid YAML: "),
    "endless number": ("agents: " + "9" * 5000, r"^s\.yaml:1: agents: "),
    "deep": ("[" * 5000, r"^s\.yaml: nested too deeply"),
    "deep braces": ("a: " + "{" * 101, r"^s\.yaml: nested too deeply"),
}


@pytest.mark.parametrize("text, said", WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_said_with_file_line_and_key(text, said):
    with pytest.raises(InputError, match=said) as caught:
        parse_scenario(text, source="s.yaml")
    assert "\n" not in str(caught.value)


@given(st.text(alphabet="agents:bud 3-[]{}!&*?|>'\"%@#,\n.e~<", max_size=40))
def test_any_text_is_read_or_refused(text):
    try:
        parse_scenario(text)
    except InputError as error:
        assert "\n" not in str(error)


def test_files_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.yaml: cannot read the scenario: No such file"):
        load_scenario(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="cannot read the scenario: Is a directory"):
        load_scenario(tmp_path)
    (tmp_path / "latin.yaml").write_bytes(b"field: \xe9")
    with pytest.raises(InputError, match=r"latin\.yaml: not UTF-8 text \(byte 7\)"):
        load_scenario(tmp_path / "latin.yaml")
    (tmp_path / "bad.yaml").write_text("agents: 2\nspeed: fast\n")
    with pytest.raises(InputError) as caught:
        load_scenario(tmp_path / "bad.yaml")
    assert str(caught.value).startswith(f"{tmp_path / 'bad.yaml'}:2: speed: 'fast' is not a speed")


def test_a_relative_field_starts_at_the_file(tmp_path, monkeypatch):
    (tmp_path / "surveys").mkdir()
    file = tmp_path / "surveys" / "survey.yaml"
    file.write_text("field: ../data/field.npy\n")
    assert load_scenario(file).field == str(tmp_path / "data" / "field.npy")
    monkeypatch.chdir(tmp_path / "surveys")
    assert load_scenario("survey.yaml").field == os.path.join("..", "data", "field.npy")
    file.write_text(f"field: {tmp_path / 'field.npy'}\n")
    assert load_scenario("survey.yaml").field == str(tmp_path / "field.npy")


@pytest.mark.parametrize("folder", [".", "out", os.path.join("out", "deep")])
@pytest.mark.parametrize("field", [None, "field.npy", os.path.join("data", "field.npy"), "/data/field.npy"])
def test_a_saved_scenario_means_the_same_file(tmp_path, monkeypatch, folder, field):
    monkeypatch.chdir(tmp_path)
    (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    scenario = Scenario(agents=5, field=field)
    save_scenario(scenario, os.path.join(folder, "survey.yaml"))
    assert load_scenario(os.path.join(folder, "survey.yaml")) == scenario
    absolute = load_scenario(tmp_path / folder / "survey.yaml").field
    assert absolute == (None if field is None else str(tmp_path / field))


def test_saving_replaces_the_file_and_leaves_nothing_else(tmp_path):
    file = tmp_path / "survey.yaml"
    for agents in (2, 3):
        save_scenario(Scenario(agents=agents), file)
        assert load_scenario(file) == Scenario(agents=agents)
        assert file.read_text(encoding="utf-8") == dump_scenario(Scenario(agents=agents))
    assert os.listdir(tmp_path) == ["survey.yaml"]


@pytest.mark.parametrize("broken", ["fsync", "replace"])
def test_a_failed_save_leaves_the_old_file(tmp_path, monkeypatch, broken):
    file = tmp_path / "survey.yaml"
    save_scenario(Scenario(agents=2), file)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, broken, full)
    with pytest.raises(InputError, match=r"survey\.yaml: cannot be written: No space left on device$"):
        save_scenario(Scenario(agents=3), file)
    assert load_scenario(file).agents == 2
    assert os.listdir(tmp_path) == ["survey.yaml"]


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match="cannot be written: No such file or directory"):
        save_scenario(Scenario(), tmp_path / "none" / "survey.yaml")
    with pytest.raises(InputError, match="cannot be written: Is a directory"):
        save_scenario(Scenario(), tmp_path)
    assert os.listdir(tmp_path) == []


def test_the_documentation_is_up_to_date():
    page = PAGE.read_text(encoding="utf-8")
    assert with_field_table(page) == page, "run: python -m tests.tools.scenario_table"


def test_the_example_in_the_documentation_is_a_scenario():
    example = PAGE.read_text(encoding="utf-8").partition("```yaml\n")[2].partition("```")[0]
    scenario = parse_scenario(example, folder="surveys")
    assert scenario.budgets == (3.0, 3.0, 4.5)
    assert scenario.field == os.path.join("surveys", "data", "algae.tif")
    four = scenario.replace(agents=4, budget=3)
    assert four.starts == ((0.1, 0.1),) * 4


def test_a_page_without_markers_is_refused():
    with pytest.raises(InputError, match="no place for the table"):
        with_field_table("# The scenario\n")
