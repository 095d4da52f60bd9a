"""The demonstration's world: a real piece of sea bed, in metres and degrees."""

from importlib.util import find_spec

import numpy as np
import pytest

from maipp.cli.demo import DEPTH, INTERESTING, START, bathymetry, scenario_for


def test_the_demo_s_field_is_the_strait():
    field = bathymetry()
    depth = np.asarray(field.values) * DEPTH
    assert depth.min() == 0.0 and 400 < depth.max() < 500
    scenario = scenario_for(field.reference)
    assert scenario.extent == field.domain
    assert 0.05 < (depth >= INTERESTING).mean() < 0.25
    assert field.reference.to_user_values(scenario.threshold) == pytest.approx(INTERESTING)
    assert field.reference.to_user(np.array(scenario.start)) == pytest.approx(np.array(START))
    # A degree of longitude is shorter than one of latitude there: the proportions are metric.
    scale_x, scale_y = (size / side for size, side in zip(field.reference.size, field.domain, strict=True))
    assert scale_y / scale_x == pytest.approx(np.cos(np.radians(49.4)), abs=0.01)


@pytest.mark.slow
def test_the_demo_leaves_its_files(tmp_path, capsys):
    from maipp.cli.demo import DemoFlags, run

    assert run(DemoFlags(out=tmp_path, planner="random")) == 0
    assert len(list(tmp_path.iterdir())) == (6 if find_spec("plotly") else 5)
    printed = capsys.readouterr().out
    assert "deeper than 150 m" in printed and "m (RMSE)" in printed
