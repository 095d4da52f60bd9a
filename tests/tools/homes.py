"""Do robots come home, and what does it cost? Every planner in random areas with islands, with and without an end.

    python -m tests.tools.homes --areas 200

Ends are the start, or another place drawn for each area; reserves are 0, 10, 20 and 30 % of the budget in turn.
"""

import argparse
import sys
from typing import Any

import numpy as np
import shapely

from maipp.roadmap import free_space
from tests.planners.test_areas import CASES
from tests.shared.area_surveys import Surveyor
from tests.shared.random_areas import BUDGET, Area, random_area

RESERVES = (0.0, 0.1, 0.2, 0.3)
# Of what may be spent, the way to another end takes at most this part.
NEAR = 0.8
TOLERANCE = 1e-5  # domain units; positions and odometers are sums in float32


def start_of(area: Area) -> tuple[float, float]:
    """Where the robots set out."""
    assert area.scenario.starts is not None
    return area.scenario.starts[0]


def another(area: Area, seed: int, reserve: float) -> tuple[float, float]:
    """A place in the area that can be reached with something to spare."""
    rng, start = np.random.default_rng([43, seed]), np.array(start_of(area))
    free = free_space(area.scenario.obstacles, area.scenario.extent)
    while True:
        place = rng.random(2)
        if shapely.contains_xy(area.free, *place):
            if free.length_between(start, place) <= NEAR * (BUDGET - reserve):
                return float(place[0]), float(place[1])


def main() -> int:
    """Print a row for each planner and kind of end; 1 where a robot was late, lost or in a zone."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--areas", type=int, default=200)
    parser.add_argument("--planners", nargs="+", default=list(CASES), choices=list(CASES))
    flags = parser.parse_args()
    areas = [random_area(seed) for seed in range(flags.areas)]
    print("planner, end, robots, home, late, legs through zones, Tr(P) with over without, se", flush=True)
    wrong = 0
    for case in flags.planners:
        name, options = CASES[case]
        free, bound = Surveyor(name, options), Surveyor(name, options, homes=True)
        without = [free.survey(area, seed).trace for seed, area in enumerate(areas)]
        for kind in ("start", "other"):
            row = bound_row(bound, areas, kind, np.array(without))
            wrong += row["robots"] - row["home"] + row["late"] + row["crossed"]
            ratio = f"{row['ratio']:.3f}, {row['se']:.3f}"
            print(
                f"{case}, {kind}, {row['robots']}, {row['home']}, {row['late']}, {row['crossed']}, {ratio}", flush=True
            )
    return int(wrong > 0)


def bound_row(surveyor: Surveyor, areas: list[Area], kind: str, without: np.ndarray) -> dict[str, Any]:
    """What came of the surveys that have an end."""
    home = late = crossed = robots = 0
    traces = []
    for seed, area in enumerate(areas):
        reserve = BUDGET * RESERVES[seed % len(RESERVES)]
        end = start_of(area) if kind == "start" else another(area, seed, reserve)
        found = surveyor.survey(area, seed, end, reserve)
        gaps = [float(np.hypot(*(route[-1] - np.asarray(end, np.float32)))) for route in found.routes]
        robots += len(gaps)
        home += sum(gap <= TOLERANCE for gap in gaps)
        late += int((found.odometer > BUDGET - reserve + TOLERANCE).sum())
        crossed += found.crossed
        traces.append(found.trace)
    ratio = np.array(traces) / without
    se = float(ratio.std(ddof=1) / len(ratio) ** 0.5)
    return {"robots": robots, "home": home, "late": late, "crossed": crossed, "ratio": float(ratio.mean()), "se": se}


if __name__ == "__main__":
    sys.exit(main())
