"""The elliptic cone of :mod:`shape_case` with a flow parameter that rolls it."""

from dataclasses import replace
from functools import cache

import numpy as np
from shape_case import flown, grid_conditions, grid_snapshots, shape_structure, shape_vehicle

from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.manifold.nonlinear_build import with_manifold
from strainfmu.estimator.map.inverse_map import InverseMap

DEFLECTIONS = (-4.0, -2.0, 0.0, 2.0, 4.0)
NAME = "fin_deg"


def deflected(snapshots: Snapshots, deflection: np.ndarray) -> Snapshots:
    """Return ``snapshots`` with a pressure that rolls the body, by a cubic of the ``deflection`` (k,) [deg]."""
    point, scaled = snapshots.surface.point, deflection / 4.0
    twist = np.sin(2.0 * np.arctan2(point[:, 1], point[:, 2])) * (point[:, 0] / point[:, 0].max()) ** 4
    ambient = np.array([condition.ambient_pressure for condition in snapshots.conditions()])
    change = 3.0 * (scaled + 0.3 * scaled**3)
    return replace(
        snapshots,
        condition=np.column_stack([snapshots.condition, deflection]),
        pressure=snapshots.pressure + ambient[:, None] * change[:, None] * twist,
        settings={**snapshots.settings, "parameters": [NAME]},
    )


def chosen(snapshots: Snapshots, rows: np.ndarray) -> Snapshots:
    names = ("condition", "pressure", "internal_pressure", "solved", "flow", "momentum_error", "repairs")
    return replace(snapshots, **{name: getattr(snapshots, name)[rows] for name in names}, mass_error=None)


@cache
def snapshots_of_grid() -> Snapshots:
    count = len(grid_conditions())
    repeated = chosen(grid_snapshots(), np.tile(np.arange(count), len(DEFLECTIONS)))
    return deflected(repeated, np.repeat(DEFLECTIONS, count))


@cache
def known_map(keep_field: bool = False) -> InverseMap:
    vehicle = shape_vehicle(discrepancy_of_prior_percent=0.1, keep_field=keep_field)
    snapshots = snapshots_of_grid()
    structure = shape_structure(snapshots.surface)
    return with_manifold(build_inverse_map(vehicle, snapshots, structure), vehicle, snapshots, structure)


@cache
def flights() -> tuple[Snapshots, np.ndarray, dict[str, np.ndarray]]:
    """Return flights at random deflections, readings (k, n_d), and dynamic pressure and Mach number by name."""
    random = np.random.default_rng(3)
    conditions = grid_conditions(mach=(6.2, 6.8), alpha=(-3.0, 1.0, 2.5), beta=(-1.5, 0.4))
    snapshots = deflected(flown(conditions), random.uniform(-4.0, 4.0, len(conditions)))
    net = snapshots.pressure - snapshots.internal_pressure[:, None]
    strain = net @ shape_structure(snapshots.surface).strain_operator("four_rows").T
    names = "dynamic_pressure", "mach_number"
    flow = {name: np.array([getattr(one, name) for one in snapshots.conditions()]) for name in names}
    return snapshots, strain + known_map().noise_std * random.standard_normal(strain.shape), flow
