"""`--vehicle simulated`: a computed vehicle on a map of the user's, or on a field drawn from the mission's kernel."""

import hashlib
import math
from collections.abc import Mapping
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from maipp.errors import InputError
from maipp.fleet.simulated import Errors, Field, Simulated
from maipp.fleet.vehicles import VehicleContext, numbers
from maipp.seeds import check_seed
from maipp.surveys.drawn_fields import drawn_fields
from maipp.surveys.raster_field import raster_field

OPTIONS = {
    "raster": "",
    "value": "",
    "field": "",
    "speed": math.nan,
    "drift": (0.0, 0.0),
    "position": 0.0,
    "noise": math.nan,
    "bad": 0.0,
}


def make(place: VehicleContext, options: Mapping[str, str]) -> Simulated:
    """The vehicle; options: raster, value, field, speed, drift, position, noise, bad (docs/vehicles.md).

    Raises `InputError` for one that is unknown or wrong.
    """
    told, survey = numbers(options, OPTIONS), place.survey
    units, scenario = survey.setup.units, survey.world.scenario
    noise, speed = told["noise"], survey.robot(place.robot).speed
    if "noise" not in options:
        (noise,) = units.std_out(np.array([scenario.noise**0.5]))
    if "speed" in options:
        speed = units.speed("--with speed", told["speed"])
    try:
        errors = Errors(told["drift"], told["position"], noise, told["bad"], seed=seed_of(place.robot, place.seed))
    except InputError as error:
        raise InputError(f"--with {error}") from None
    start = np.asarray(survey.world.mission.start[survey.names.index(place.robot)], np.float64)
    field = truth(place, told["raster"], told["value"], told["field"])
    state, interval = place.folder / "vehicle.json", scenario.measurement_interval
    return Simulated(units, start, speed, interval, field, place.clock, errors=errors, state=state)


def truth(place: VehicleContext, raster: str = "", value: str = "", number: str = "") -> Field:
    """Standardised values of the field at domain positions, the same for all robots of a survey.

    Those of a map, with its array or column `value`; or of the draw of that number from the mission's kernel; with
    neither of a scenario its own ground truth, and of a mission the draw with the survey's seed. Raises `InputError`.
    """
    scenario = place.survey.world.scenario
    if raster:
        if number:
            raise InputError(f"--with field={number}: there is a raster too; give one of them")
        if place.mission is None:
            raise InputError(f"--with raster={raster}: a scenario file has no place; give a mission file")
        field = raster_field(place.mission, Path(raster), value or None)
    elif value:
        raise InputError(f"--with value={value}: of no map; give the raster too")
    elif number or place.mission is not None:
        seed = _whole(number) if number else place.seed
        field = jax.tree.map(lambda array: array[0], drawn_fields(place.mission or scenario, 1, seed))
    else:
        field = place.survey.world.mission.field

    @eqx.filter_jit
    def at(points: jax.Array) -> jax.Array:
        return field(points)

    real = jnp.result_type(float)
    return lambda points: np.asarray(at(jnp.asarray(points, real)), np.float64)


def seed_of(robot: str, seed: int) -> int:
    """A seed for this robot's errors."""
    return int.from_bytes(hashlib.sha256(f"{seed} {robot}".encode()).digest()[:8], "big")


def _whole(number: str) -> int:
    try:
        seed = int(number)
    except ValueError:
        raise InputError(f"--with field={number}: not as it should be; give a whole number >= 0") from None
    return check_seed(seed, "--with field")
