"""Fit of a file of snapshots to a vehicle: the same body, and its entries where no option set them aside.

A map needs the pressure on its vehicle's surface, whatever engine, cells and conditions it comes from. Internal
pressure and reference quantities are taken from the vehicle file, so those in the snapshots need not agree.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from builder.aero.engines.registry import make_engine
from builder.aero.shapes import outer_surface
from builder.campaign.campaign_run import Campaign, vehicle_campaign
from builder.campaign.failures import failed_conditions
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.vehicle.file import Vehicle
from builder.vehicle.shape.geometry import BodyOfRevolution
from builder.vehicle.shape.profile_entries import profile_misfits
from builder.vehicle.toml.toml_sections import CLOSEST_VALUES
from builder.workspace import Misfit
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.flight_condition import CONDITION_COLUMNS, FlightCondition

SAME_SURFACE = 1e-6  # of the length: nodes on the meridian
SAME_LENGTH = 0.02  # of the length: surfaces of other programs may be cut at the tip


def vehicle_misfits(snapshots: Snapshots, vehicle: Vehicle) -> list[Misfit]:
    """Return in what the body of ``snapshots`` differs from ``vehicle``; of free surfaces their extents."""
    if vehicle.has_meridian:
        return body_misfits(snapshots, vehicle.body())
    surface = outer_surface(vehicle, vehicle.resolution.map)[0]
    expected, extent = (np.ptp(points, axis=0) for points in (surface.point, snapshots.point))
    return [
        Misfit(entry=f"extent of the surface along {axis}", expected=f"{wanted:.6g} m", actual=f"{actual:.6g} m")
        for axis, wanted, actual in zip("xyz", expected, extent, strict=True)
        if abs(actual - wanted) > SAME_LENGTH * expected.max()
    ]


def body_misfits(snapshots: Snapshots, body: BodyOfRevolution) -> list[Misfit]:
    """Return in what the body of ``snapshots`` is not ``body``: entries of its meridian, or its surface's size."""
    profile = snapshots.settings.get("profile", snapshots.settings.get("inputs", {}).get("profile"))
    if profile is not None and all("start_half_angle_deg" in piece for piece in profile):
        return profile_misfits(profile, body)
    length = float(np.ptp(snapshots.point[:, 0]))
    if abs(length / body.length - 1.0) > SAME_LENGTH:
        return [Misfit(entry="length of the surface", expected=f"{body.length:.6g} m", actual=f"{length:.6g} m")]
    grid = snapshots.grid
    if grid is None:
        return []
    expected = body.radius(np.minimum(grid.x, body.length))
    worst = int(np.abs(grid.radius - expected).argmax())
    if abs(grid.radius[worst] - expected[worst]) <= SAME_SURFACE * body.length:
        return []
    where = f"radius at x = {grid.x[worst]:.4g} m"
    return [Misfit(entry=where, expected=f"{expected[worst]:.6g} m", actual=f"{grid.radius[worst]:.6g} m")]


def option_misfits(snapshots: Snapshots, vehicle: Vehicle) -> list[Misfit]:
    """Return in what ``snapshots`` differ from a campaign of the vehicle file with the options they hold.

    Snapshots of an unknown origin hold no options: nothing is expected of them here.

    Raises
    ------
    InputError
        The vehicle file lacks an entry that the engine needs.
    """
    options = snapshots.settings.get("options")
    if options is None:
        return []
    engine_name = options.get("engine") or vehicle.aerodynamics.engine
    if engine_name != snapshots.engine:
        return [Misfit(entry="aerodynamics.engine", expected=engine_name, actual=snapshots.engine)]
    engine = make_engine(vehicle, engine_name, vehicle.resolution.map, options.get("grid"))
    campaign = vehicle_campaign(vehicle, engine)
    wanted, inputs = _plain(engine.inputs()), snapshots.settings.get("inputs", {})
    misfits = _differences({**wanted, "profile": None}, {**inputs, "profile": None}, f"{engine_name} engine")
    if options.get("set"):
        return misfits
    conditions = _requested(snapshots)
    if len(conditions) != len(campaign.conditions):
        return [
            *misfits,
            Misfit(entry="conditions", expected=f"{len(campaign.conditions)}", actual=f"{len(conditions)}"),
        ]
    for number, (taken, asked) in enumerate(zip(conditions, campaign.conditions, strict=True), start=1):
        if taken != asked:
            return [*misfits, Misfit(entry=f"condition {number}", expected=str(asked), actual=str(taken))]
    return misfits


def _requested(snapshots: Snapshots) -> list[FlightCondition]:
    """Return the conditions of the campaign in their order, those that could not be solved included."""
    conditions = snapshots.conditions()
    for failure in sorted(failed_conditions(snapshots), key=lambda failure: failure.number):
        conditions.insert(failure.number, failure.condition)
    return conditions


def as_flown(vehicle: Vehicle, snapshots: Snapshots) -> Vehicle:
    """Return the vehicle file with the engine and the ranges of conditions that ``snapshots`` really have.

    What is measured on a map must be measured where the map holds. With full symmetry that is a disc of total
    incidence. The file itself where it has the conditions of the snapshots.
    """
    conditions = _requested(snapshots)
    same = snapshots.engine == vehicle.aerodynamics.engine
    if same and set(conditions) == set(vehicle.flight_conditions()):
        return vehicle
    mach, alpha, beta, altitude, *values = (np.unique(column) for column in snapshots.condition.T)
    # Deflected surfaces are of the newtonian engine alone.
    no_surfaces: dict[str, Any] = {} if snapshots.engine == "newtonian" else {"surfaces": []}
    parameters = {
        name: vehicle.conditions.parameters[name].model_copy(update={"values": apart(column), **no_surfaces})
        for name, column in zip(snapshots.parameter_names, values, strict=True)
    }
    alpha, beta = np.degrees(alpha), np.degrees(beta)
    if vehicle.map.symmetry == "full":
        alpha, beta = np.degrees([0.0, snapshots.total_incidence.max()]), np.zeros(1)
    entries = {
        **dict(zip(CONDITION_COLUMNS, map(apart, (mach, alpha, beta, 1e-3 * altitude)), strict=True)),
        "parameters": parameters,
    }
    return vehicle.model_copy(
        update={
            "conditions": vehicle.conditions.model_copy(update=entries),
            "aerodynamics": vehicle.aerodynamics.model_copy(update={"engine": snapshots.engine}),
        }
    )


def apart(values: FloatArray) -> list[float]:
    """Return rising ``values`` as a file lists them: of those that only rounding distinguishes, the first."""
    first = np.diff(values, prepend=-np.inf) >= CLOSEST_VALUES
    return [float(value) for value in values[first]]


def flow_record(snapshots: Snapshots) -> dict[str, Any]:
    """Return what made ``snapshots``, for the provenance of a map: engine, its settings, sets of conditions."""
    settings = snapshots.settings
    inputs = {
        name: value for name, value in settings.get("inputs", {}).items() if name not in ("profile", "engine")
    }
    sets = [f"{entry['name']} ({entry['conditions']})" for entry in settings.get("sets", [])]
    return _plain(
        {
            "engine": snapshots.engine,
            **inputs,
            "sets": sets,
            "conditions_not_solved": len(failed_conditions(snapshots)),
            "options": settings.get("options", {}),
            "strainfmu_version": settings.get("strainfmu_version", "unknown"),
        }
    )


def flow_line(snapshots: Snapshots) -> str:
    """Return in a few words what made ``snapshots``."""
    settings = snapshots.settings
    grid = settings.get("inputs", {}).get("marching_grid")
    cells = "" if grid is None else f" on {grid['n_radial']} x {grid['n_circumferential']} cells"
    sets = ", ".join(entry["name"] for entry in settings.get("sets", [])) or "unknown"
    return f"{snapshots.engine} engine{cells}, {len(snapshots.condition)} conditions, of {sets}"


def replaced_line(path: Path, campaign: Campaign) -> str | None:
    """Return in one line what ``campaign`` replaces at ``path``; None where what is there is part of it."""
    if not path.is_file():
        return None
    try:
        present = load_snapshots(path)
    except InputError:
        return None
    same_source = present.settings.get("inputs") == _plain(campaign.engine.inputs())
    if same_source and set(present.conditions()) <= set(campaign.conditions):
        return None
    return f"{path}: held {flow_line(present)}; replaced"


def _differences(expected: Any, actual: Any, where: str) -> list[Misfit]:
    """Return the entries in which two JSON values differ."""
    if isinstance(expected, dict) and isinstance(actual, dict):
        names = sorted(expected.keys() | actual.keys())
        return [
            misfit
            for name in names
            for misfit in _differences(expected.get(name), actual.get(name), f"{where}, {name.replace('_', ' ')}")
        ]
    return [] if expected == actual else [Misfit(entry=where, expected=_short(expected), actual=_short(actual))]


def _short(value: Any) -> str:
    text = "none" if value is None else json.dumps(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def _plain(value: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``value`` as it comes back from JSON."""
    plain: dict[str, Any] = json.loads(json.dumps(value))
    return plain
