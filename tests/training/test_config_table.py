"""The pages of training say of the configuration and the files what the code has."""

import dataclasses
import re
from pathlib import Path

import pytest

from maipp.errors import InputError
from maipp.records import fields_of
from maipp.training.config import NAMED, TrainConfig
from maipp.training.train import train
from tests.tools.config_table import with_config_table, with_config_tables

DOCS = Path(__file__).parents[2] / "docs"
PAGE, KEYS = ((DOCS / name).read_text(encoding="utf-8") for name in ("training.md", "training-keys.md"))


def test_the_table_is_the_dataclass_s():
    assert with_config_tables(KEYS) == KEYS, "run: python -m tests.tools.config_table docs/training-keys.md"


def test_every_key_has_a_meaning_and_a_row():
    assert all(row.meaning for row in fields_of(TrainConfig))
    head, _, *rows = re.findall(r"^\|.*\|$", with_config_table("<!-- keys -->\n<!-- /keys -->"), flags=re.MULTILINE)
    assert [row.split("`")[1] for row in rows] == [field.name for field in dataclasses.fields(TrainConfig)]
    assert all(f"`{name}`" in head for name in NAMED)


def test_a_page_without_a_place_for_it():
    with pytest.raises(InputError, match="no place for the table"):
        with_config_table("nothing here")


def test_the_files_of_a_run_are_those_that_are_listed(fake, monkeypatch, tmp_path):
    monkeypatch.setattr("maipp.training.train.HeldOutWorlds", fake.FakeWorlds)
    train(fake.fake_config(1), tmp_path, learner=fake.FakeLearner())
    listed = set(re.findall(r"`([\w.]+)/?`", " ".join(re.findall(r"^\| (`[^|]+`) \|", PAGE, flags=re.MULTILINE))))
    assert {path.name for path in tmp_path.iterdir()} <= listed
