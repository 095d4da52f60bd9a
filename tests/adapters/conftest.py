"""A small survey that all these tests share, so that it compiles once."""

import pytest

from maipp import Scenario


@pytest.fixture(scope="session")
def small():
    """Three robots on small roadmaps."""
    return Scenario(agents=3, budget=1.2, grid=8, nodes=14, neighbours=4)
