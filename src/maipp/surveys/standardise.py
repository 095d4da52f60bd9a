"""From a mission file to the one problem that every planner knows: domain units and standardised values."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from shapely.geometry import Polygon

from maipp.errors import InputError
from maipp.geo import Crs, GeoReference, unwrap, wrap
from maipp.planners import planner_note
from maipp.records import FieldError
from maipp.scenario import Scenario
from maipp.surveys.area import OperatingArea, PlaceNames, as_region, operating_area
from maipp.surveys.complement import complement, without_holes
from maipp.surveys.homes import distances_home
from maipp.surveys.mission_file import MissionFile
from maipp.surveys.prior import MOST_SAMPLES, Prior, find_prior, hyper_prior
from maipp.surveys.projected_area import ProjectedArea, ends_of, find_place, starts_of
from maipp.typing import Float

if TYPE_CHECKING:
    from maipp.belief.refit import HyperPrior
    from maipp.engine.decision import Planner

# A standardised threshold below anything that a belief rules out: the whole area is of interest.
EVERYTHING = -4.0
# A place is ruled out where the mean lies this many times its standard deviation below the threshold. The paper's 1,
# but where the threshold lies high above the prior mean so much that the unknown counts as possibly high, as there.
_PAPER_BETA, _PRIOR_BETA = 1.0, 2.0
_GRIDS = (30, 40, 50, 60)
_ENOUGH_POINTS = 150  # evaluation points that an area should hold; the paper's has 900
_NODES, _NEIGHBOURS_PER_NODE = 200, 0.1  # the paper's
_MOST_NODES = 400
_MANY, _TOO_MANY = 400, 5000  # measurements of one robot: slow, and more than the simulation has room for
_STRAIGHT = 1e-7  # user coordinates: off a straight line by less (1 cm, as files are written) is on it
_MOST_FENCE = 150  # vertices of the area's border in route files; autopilots hold few


@dataclass(frozen=True, eq=False)
class PreparedSurvey:
    """A survey ready to be planned, rehearsed or run live."""

    survey: MissionFile
    scenario: Scenario  # domain units, standardised values; the fastest robot has speed 1
    frame: GeoReference  # from WGS84 degrees, or metres of no known place, to the domain
    crs: Crs  # of the positions in the mission file
    planner: str
    planner_options: Mapping[str, Any]
    names: tuple[str, ...]  # of the robots, in the order of the scenario's agents
    seconds_per_time: float  # seconds in the scenario's unit of time
    prior_x: Float[np.ndarray, "p 2"]  # old samples, domain units
    prior_y: Float[np.ndarray, " p"]  # standardised values
    fit: Any  # belief.fit.KernelFit where the kernel was fitted to samples, else None
    region: Polygon  # where routes may go, local metres
    margin: float  # metres that routes keep from everything they must not cross, at least
    area: Float[np.ndarray, "v 2"]  # border of the area, user coordinates
    no_go: tuple[Float[np.ndarray, "_ 2"], ...]  # borders of what must not be entered, user coordinates
    warnings: tuple[str, ...]
    prior_noise: float  # standardised variance of the old samples' noise
    adapt: "HyperPrior | None" = None  # what the kernel is refitted with under way; None: it stays as it is

    def make_planner(self) -> "Planner":
        """The planner, built for the scenario. Raises `InputError` for a planner or option that does not fit."""
        return build_planner(self.survey, self.scenario, self.planner, self.planner_options)

    @property
    def free_area(self) -> float:
        """The area without its islands and no-go zones, before a strip along its borders is left out: true m2."""
        outline, *closed = (Polygon(self.frame.to_plane(ring)) for ring in (self.area, *self.no_go))
        return shapely.difference(outline, as_region(closed)).area

    @property
    def prior(self) -> tuple[Float[np.ndarray, "p 2"], Float[np.ndarray, " p"]] | None:
        """Places and values of the old samples as `draw_missions` takes them; None without any."""
        return (self.prior_x, self.prior_y) if len(self.prior_y) else None


def prepare(
    survey: MissionFile,
    *,
    planner: str | None = None,
    planner_options: Mapping[str, Any] | None = None,
) -> PreparedSurvey:
    """The standardised problem of a survey; `planner` and its options replace the file's.

    Raises `InputError`, one line that names file, line and key, for whatever makes the survey impossible. What is odd
    but possible is in `warnings`.
    """
    place = find_place(survey)
    starts, ends, told = starts_of(survey, place), ends_of(survey, place), PlaceNames(place.frame)
    every = [*starts, *itertools.chain.from_iterable(ends)]
    space = operating_area(
        place.area, place.no_go, every, survey.clearance_m, survey.where("area"), told, survey.ashore_m
    )
    prior = find_prior(survey, place, space)
    warnings = [
        *place.warnings,
        *space.warnings,
        *prior.warnings,
        *filter(None, [planner_note(planner or survey.planner)]),
    ]
    scenario = _scenario(survey, prior, space, warnings)
    x, y = _thinned(prior, warnings)
    name = planner or survey.planner
    options = survey.planner_options if planner in (None, survey.planner) else {}
    area, no_go = _borders(place, space)
    return PreparedSurvey(
        survey=survey,
        scenario=scenario,
        frame=prior.frame,
        crs=place.crs,
        planner=name,
        planner_options={**options, **(planner_options or {})},
        names=tuple(robot.name for robot in survey.robots),
        seconds_per_time=prior.frame.scale / max(robot.speed for robot in survey.robots),
        prior_x=x,
        prior_y=y,
        fit=prior.fit,
        region=space.region,
        margin=space.margin,
        area=area,
        no_go=no_go,
        warnings=tuple(warnings),
        prior_noise=prior.sample_noise,
        adapt=hyper_prior(survey, scenario, prior.fit),
    )


def build_planner(survey: MissionFile, scenario: Scenario, name: str, options: Mapping[str, Any]) -> "Planner":
    """The planner of that name for a survey's scenario; `InputError` where it would cross no-go zones."""
    from maipp.planners import make_planner, planner_class, planner_names

    try:
        built = make_planner(name, scenario, options)
    except InputError as error:
        raise InputError(f"{survey.where('planner')}: {str(error).removeprefix('planner ')}") from None
    if scenario.obstacles and not built.avoids_obstacles:
        able = ", ".join(each for each in planner_names() if planner_class(each).avoids_obstacles)
        raise InputError(f"{survey.where('planner')}: {name} does not keep inside an area; give one of {able}")
    return built


def _scenario(survey: MissionFile, prior: Prior, space: OperatingArea, warnings: list[str]) -> Scenario:
    """The scenario; adds to the warnings."""
    frame = prior.frame
    scale = frame.scale
    width, height = frame.domain
    free = shapely.transform(space.region, frame.plane_to_domain)
    fastest = max(robot.speed for robot in survey.robots)
    places = np.clip(frame.plane_to_domain(space.starts), 0.0, frame.domain).tolist()
    starts, ends = places[: len(survey.robots)], _ends(survey, places)
    nodes = _nodes(space.region)
    values: dict[str, Any] = {
        "agents": len(survey.robots),
        "budget": [robot.budget_m / scale for robot in survey.robots],
        "speed": [robot.speed / fastest for robot in survey.robots],
        "start": starts,
        "end": ends if any(ends) else None,
        "reserve": [robot.reserve_m / scale for robot in survey.robots],
        "comm_range": None if survey.communication_range_m is None else survey.communication_range_m / scale,
        "measurement_interval": survey.measurement_spacing_m / scale,
        "extent": [width, height],
        "obstacles": [list(part.exterior.coords)[:-1] for part in complement(free, frame.domain)],
        "field_family": "any",
        "length_scale": prior.length_scale,
        "noise": prior.noise,
        "nodes": nodes,
        "neighbours": round(_NEIGHBOURS_PER_NODE * nodes),
        "grid": _grid(free, frame.domain),
    }
    values |= _interest(survey, frame, warnings)
    _check_measurements(survey, warnings)
    try:
        scenario = Scenario.from_dict(values | dict(survey.scenario))
    except FieldError as error:
        key = error.key.partition("[")[0]
        told = {"measurement_interval": "measurement_spacing_m", "comm_range": "communication_range_m"}
        named = f"scenario.{key}" if key in survey.scenario else told.get(key, "robots" if key == "budget" else key)
        raise InputError(f"{survey.where(named)}: {error.problem}") from None
    if scenario.homes:
        _check_ends(survey, scenario, scale)
    if not _inside(free, scenario.grid, frame.domain).any():
        raise InputError(
            f"{survey.where('area')}: so narrow that no point of the evaluation grid lies in it; "
            "give scenario.grid above 60, or a smaller clearance_m"
        )
    return scenario


def _ends(survey: MissionFile, places: list[list[float]]) -> list[list[list[float]]]:
    """Where each robot may end, of its start and the further places in the order of the robots; none: anywhere."""
    further, ends = iter(places[len(survey.robots) :]), []
    for robot, start in zip(survey.robots, places, strict=False):
        own = list(itertools.islice(further, len(robot.end) if isinstance(robot.end, tuple) else 0))
        home = robot.end == "start" or (robot.end is None and survey.return_home)
        ends.append([start] if home else own)
    return ends


def _check_ends(survey: MissionFile, scenario: Scenario, scale: float) -> None:
    """Raise `InputError` for a robot whose budget does not take it to its end."""
    for robot, (_, away) in zip(survey.robots, distances_home(scenario), strict=True):
        if away is None:
            continue
        spendable = robot.budget_m - robot.reserve_m
        if away * scale > spendable:
            raise InputError(
                f"{robot.end_where}: {robot.name} ends {away * scale:.0f} m away by the shortest way, and may travel "
                f"{spendable:.0f} m without its reserve; give a nearer end or a larger budget"
            )


def _interest(survey: MissionFile, frame: GeoReference, warnings: list[str]) -> dict[str, float]:
    """The threshold in standardised values, and the confidence that rules places out."""
    if survey.threshold is None:
        return {"threshold": EVERYTHING, "beta": _PAPER_BETA}
    threshold = float(frame.to_domain_values(survey.threshold))
    if abs(threshold) > 100:
        raise InputError(
            f"{survey.where('threshold')}: {survey.threshold:g} lies {abs(threshold):.3g} prior standard deviations "
            f"({frame.std:.3g}) from the prior mean ({frame.mean:.3g}); give a threshold that values can reach"
        )
    if threshold > 3:
        side = "below" if survey.below else "above"
        warnings.append(
            f"the threshold lies {threshold:.1f} prior standard deviations {side} the prior mean: hardly any place is "
            "expected to reach it"
        )
    return {"threshold": threshold, "beta": interest_beta(threshold)}


def interest_beta(threshold: float) -> float:
    """The confidence that rules places out, of a standardised threshold."""
    return max(_PAPER_BETA, _PRIOR_BETA * threshold)


def _check_measurements(survey: MissionFile, warnings: list[str]) -> None:
    robot = max(survey.robots, key=lambda robot: robot.budget_m)
    count = robot.budget_m / survey.measurement_spacing_m
    if count > _TOO_MANY:
        raise InputError(
            f"{survey.where('measurement_spacing_m')}: {survey.measurement_spacing_m:g} m means {count:.0f} "
            f"measurements of {robot.name}; give {robot.budget_m / _TOO_MANY:.3g} m or more"
        )
    if count > _MANY:
        warnings.append(f"{count:.0f} measurements of {robot.name}: planning will take long")


def _nodes(region: Polygon) -> int:
    """Roadmap nodes: the paper's for a square, more the more border a region has for its area."""
    compactness = 4 * math.pi * region.area / region.length**2  # pi / 4 for a square
    return int(min(max(_NODES, _NODES * math.sqrt(math.pi / 4 / compactness)), _MOST_NODES))


def _grid(free: Polygon, extent: tuple[float, float]) -> int:
    """Points per side of the evaluation grid: enough of them inside."""
    return next((side for side in _GRIDS if _inside(free, side, extent).sum() >= _ENOUGH_POINTS), _GRIDS[-1])


def _inside(free: Polygon, side: int, extent: tuple[float, float]) -> np.ndarray:
    x, y = np.meshgrid(np.linspace(0, extent[0], side), np.linspace(0, extent[1], side))
    return shapely.intersects_xy(free, x.ravel(), y.ravel())


def _thinned(prior: Prior, warnings: list[str]) -> tuple[Float[np.ndarray, "p 2"], Float[np.ndarray, " p"]]:
    """The samples, thinned by place where there are too many."""
    if len(prior.y) <= MOST_SAMPLES:
        return prior.x, prior.y
    from maipp.belief.fit_samples import thinned

    kept = thinned(prior.x, MOST_SAMPLES)
    warnings.append(f"of {len(prior.y)} samples {len(kept)}, spread evenly, are planned with")
    return prior.x[kept], prior.y[kept]


def _borders(
    place: ProjectedArea, space: OperatingArea
) -> tuple[Float[np.ndarray, "v 2"], tuple[Float[np.ndarray, "_ 2"], ...]]:
    """The border of the area's part that is surveyed, and of what must not be entered, user coordinates."""
    point = space.region.representative_point()
    parts = [part for part in shapely.get_parts(place.area) if isinstance(part, Polygon)]
    part = min(parts, key=lambda each: each.distance(point))
    # Zones are cut where they surround free water, and islands are zones of their own.
    zones = [Polygon(ring) for ring in part.interiors]
    zones += [zone for zone in without_holes(place.no_go) if zone.intersects(part)]
    # Simplified by half the margin they still lie clear of the routes.
    tolerance = space.margin / 2

    def ring(polygon: Polygon) -> Float[np.ndarray, "v 2"]:
        border = Polygon(polygon.exterior)
        if len(polygon.exterior.coords) > _MOST_FENCE:
            border = border.simplify(tolerance)
        points = place.frame.from_plane(shapely.get_coordinates(border))
        if place.frame.geographic:
            points = unwrap(points, float(points[0, 0]))
        # Positions that only the projection needed lie on straight lines again.
        points = shapely.get_coordinates(Polygon(points).simplify(_STRAIGHT))[:-1]
        return wrap(points) if place.frame.geographic else points

    return ring(Polygon(part.exterior)), tuple(ring(zone) for zone in zones)
