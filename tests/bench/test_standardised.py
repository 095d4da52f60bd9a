"""The table over length scales and shapes: worlds from the prior, cells kept, what is left of the initial trace."""

import csv
from typing import Any

import jax
import numpy as np
import pytest

from maipp.bench.cells import cells, fill
from maipp.bench.evaluate import prior_missions, summarise
from maipp.bench.frame import read
from maipp.bench.standardised import Standardised, initial_trace, main, spec, table
from maipp.bench.tables import SampleSize
from maipp.errors import InputError
from maipp.markdown import mean_and_error
from maipp.planners import make_planner
from maipp.scenario import Scenario

TINY = Scenario(agents=2, grid=8, nodes=12, neighbours=4, measurement_interval=1.0)


SAMPLE = SampleSize(3, 1, 0)


def every_cell(flags):
    table = spec(flags, TINY)
    return list(cells(table, table.rows, SAMPLE))


def flags(out, **changes):
    given: dict[str, Any] = {"length_scales": (0.3, 0.6), "aspects": (2.0,), "budgets": (1.0, 2.0), "instances": 3}
    values: dict[str, Any] = given | {"planners": ("random",)} | changes
    return Standardised(out=out, **values)


def test_the_files_hold_every_cell_and_are_made_once(tmp_path, capsys):
    assert main(flags(tmp_path), TINY) == 0
    every = every_cell(flags(tmp_path))
    assert len(every) == 4 and all(cell.scenario.extent == (1.0, 0.5) for cell in every)
    page = (tmp_path / "standardised.md").read_text()
    rows = list(csv.DictReader((tmp_path / "standardised.csv").open()))
    assert len(rows) == 4 * 3
    for cell in every:
        result = cell.load(tmp_path)
        assert result is not None
        summary = summarise(result.values["trace"])
        assert 0 < summary.mean < 64
        assert f"{mean_and_error(summary.mean, summary.se)} ({summary.mean / 64:.2%})" in page
        here = [row for row in rows if row["length_scale"] == f"{cell.scenario.length_scale:g}"]
        here = [float(row["trace"]) for row in here if row["budget"] == f"{cell.budget:g}"]
        np.testing.assert_allclose(here, result.values["trace"][:, 0], rtol=1e-5)
    told = capsys.readouterr().err
    assert "4/4" in told
    before = sorted((path.name, path.stat().st_mtime_ns) for path in (tmp_path / "cells").iterdir())
    assert main(flags(tmp_path), TINY) == 0
    assert "1/4" not in capsys.readouterr().err
    assert sorted((path.name, path.stat().st_mtime_ns) for path in (tmp_path / "cells").iterdir()) == before
    # What is not there yet stays empty.
    more = spec(flags(tmp_path, planners=("random", "greedy")), TINY)
    fill(list(cells(more, more.rows, SAMPLE))[:4], tmp_path)
    page = table(more, read(more, tmp_path, SAMPLE), SAMPLE)
    assert "| `random` | `greedy` |" in page and "|  |" in page


def test_worlds_are_draws_of_the_prior_and_the_same_for_all():
    scenario = TINY.replace(length_scale=0.3, extent=(1.0, 0.25), budget=1.0)
    planner = make_planner("random", scenario)
    missions = prior_missions(scenario, planner, 0, 200, 1)
    truth = np.asarray(missions.truth)
    assert truth.shape == (200, 64) and abs(truth.mean()) < 0.2 and truth.std() == pytest.approx(1.0, abs=0.1)
    corner = np.corrcoef(truth[:, 0], truth[:, 7])[0, 1]  # the left side, 0.25 long
    s = 3**0.5 * 0.25 / 0.3
    assert corner == pytest.approx((1 + s) * np.exp(-s), abs=0.15)
    # The instance fixes the world; the field is what is measured.
    again = prior_missions(scenario.replace(budget=2.0), planner, 0, 2, 2)
    np.testing.assert_allclose(np.asarray(again.truth), truth[[0, 0, 1, 1]], atol=1e-4)
    one = jax.tree.map(lambda leaf: leaf[1], (missions.field, missions.grid))
    np.testing.assert_allclose(np.asarray(one[0](one[1])), truth[1], atol=1e-4)


def test_initial_trace_is_the_prior_s():
    assert initial_trace(Scenario()) == 900
    assert initial_trace(Scenario(signal_variance=4.0, grid=10)) == 400
    assert initial_trace(Scenario(threshold=1.5)) == 0


def test_cells_differ_by_their_worlds(tmp_path):
    prior, mixture = (every_cell(flags(tmp_path, worlds=worlds))[0] for worlds in ("prior", "mixture"))
    assert (prior.worlds, mixture.worlds) == ("prior", "mixture") and prior.file != mixture.file


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"worlds": "real"}, "--worlds: 'real'.*mixture, prior"),
        ({"aspects": (0.0,)}, "--aspects: 0"),
        ({"length_scales": (float("nan"),)}, "--length-scales: nan"),
        ({"instances": 0}, "--instances: 0"),
        ({"planners": ("nobody",)}, "nobody"),
    ],
)
def test_bad_flags_give_one_line(change, problem, tmp_path, capsys):
    with pytest.raises(InputError, match=problem):
        spec(flags(tmp_path, **change), TINY)
    assert main(flags(tmp_path, **change), TINY) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_an_empty_folder_has_no_table(tmp_path):
    assert read(spec(flags(tmp_path), TINY), tmp_path, SAMPLE).made == ()
    fill([], tmp_path)
    assert not list(tmp_path.iterdir())
