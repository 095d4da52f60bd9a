"""`maipp demo`: three robots survey real bathymetry, a part of what Matplotlib ships as sample data.

The Strait of Georgia between Vancouver and its island: a trough of about 400 m through shallows and land. The trough is
of high interest. The robots are taken to fly (airborne sounding), so they may cross land, which counts as depth 0.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from maipp.scenario import Scenario
from maipp.seeds import check_seed

if TYPE_CHECKING:
    from maipp.engine.episode import Episode
    from maipp.fields.raster import Raster
    from maipp.geo import GeoReference

WEST, EAST, SOUTH = 235.0, 237.05, 48.85  # degrees; the sample goes on to the north edge of this window
DEPTH = 400.0  # metres; becomes 1 on the scenario's scale
INTERESTING = 150.0  # metres
START = (236.75, 49.3)  # off Vancouver, degrees


@dataclass(frozen=True)
class DemoFlags:
    """Survey the sea bed of the Strait of Georgia with three robots, and draw what they found."""

    out: Path = Path("out/demo")
    """folder to write to"""

    planner: str = "receding-horizon"
    """name of the planner (`maipp planners` lists them)"""

    seed: int = 0
    """seed of the planner's randomness"""


def bathymetry() -> "Raster":
    """Depths in metres on a grid of longitude and latitude, land as depth 0."""
    import numpy as np
    from matplotlib.cbook import get_sample_data

    from maipp.fields.raster import Raster, RasterData
    from maipp.geo import WGS84

    path = str(get_sample_data("topobathy.npz", asfileobj=False))
    with np.load(path) as file:
        elevation, longitude, latitude = file["topo"], file["longitude"], file["latitude"]
    columns, rows = (longitude >= WEST) & (longitude <= EAST), latitude >= SOUTH
    depth = np.maximum(-elevation[rows][:, columns], 0.0)
    names = ("longitude (deg E)", "latitude (deg N)", "depth (m)")
    data = RasterData(depth, longitude[columns], latitude[rows], path, *names, WGS84)
    return Raster.from_data(data, low=0.0, high=DEPTH)


def scenario_for(there: "GeoReference") -> Scenario:
    """Three robots that set out together; a prior fit for a trough some 20 km wide."""
    import numpy as np

    return Scenario.create(
        agents=3,
        budget=3.0,
        extent=there.domain,
        start=there.to_domain(np.array(START)).tolist(),
        threshold=float(there.to_domain_values(INTERESTING)),
        measurement_interval=0.1,
        length_scale=0.2,  # 30 km, the trough and its slopes
        signal_variance=0.2,  # depths vary by 180 m
        noise=5e-3,  # what the sea bed does between measurements; with 1e-3 the belief trusts them too far
        beta=2.0,  # with 1 the robots rule out the deep part too early: 59 m RMSE instead of 52 m (16 seeds)
    )


def run(flags: DemoFlags) -> int:
    """Plan the survey, write its files, print its numbers in metres and kilometres."""
    from maipp.cli.plan import report, survey
    from maipp.engine.area_found import found_by

    check_seed(flags.seed, "--seed")
    field = bathymetry()
    scenario = scenario_for(field.reference)
    episode, paths = survey(scenario, flags.planner, {}, seed=flags.seed, out=flags.out, field=field)
    kilometres = (field.reference.metres_per_unit or 0.0) / 1000  # in a domain unit
    found = found_by(episode)
    print(f"Strait of Georgia, {scenario.extent[0] * kilometres:.0f} x {scenario.extent[1] * kilometres:.0f} km.")
    deep = f"{found.true[0]:.0%} of the area"
    print(f"Of high interest: sea bed deeper than {INTERESTING:g} m, {deep} (land counts as 0 m).")
    report(episode, paths)
    lengths = ", ".join(f"{agent.distance * kilometres:.0f}" for agent in episode.agents)
    print(f"The robots travelled {lengths} km and mapped the depth with an error of {_metres(episode):.0f} m (RMSE),")
    print(f"where guessing the mean depth everywhere would have {episode.truth.std() * DEPTH:.0f} m.")
    print(f"{found.recall[0]:.0%} of the deep lies in the area they predict.")
    return 0


def _metres(episode: "Episode") -> float:
    return float(episode.geo.to_user_std(episode.metrics.rmse))
