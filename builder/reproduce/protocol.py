"""The protocol of the source: flight conditions, numbers of samples, noise; and the sizes of our runs.

Where the source states nothing, the choice is here, with its reason.
"""

from dataclasses import dataclass
from math import radians

from builder.campaign.scheduling import Scheduling
from builder.structure.solid.swept_mesh import RESOLUTIONS, SweptResolution
from builder.vehicle.file import Vehicle
from builder.vehicle.flight_conditions import (
    PUBLISHED_ALTITUDE,
    ConditionSet,
    condition_grid,
    condition_set,
)
from builder.vehicle.model_entries import Resolution
from strainfmu.flight_condition import FlightCondition

MODES = 5
"""r of Case 1."""

NOISE_FRACTION = 0.01
"""sigma over the median |strain| over P1 and Configuration 2, one for all layouts (the source names no set)."""

DRAWS_PER_CONDITION, DRAWS = 50, 100
"""Draws of noise: per condition in Case 1; for each example."""

PUBLISHED_GAMMA = 10**0.5
NOISE_FREE_GAMMA = 1e-6
DRAWN_MODES = (1, 3, 6, 23, 53)
"""Eigenvectors that the source draws, from 1."""

SEED = 20240815

COEFFICIENT_FLOOR = 0.1
"""epsilon_k over the maximum |C_k| of P1 (the source's normalised difference of coefficients)."""


def condition(mach: float, alpha: float, beta: float) -> FlightCondition:
    """Return M, angle of attack and of sideslip [deg] at 20 km."""
    return FlightCondition(
        mach_number=mach, angle_of_attack=radians(alpha), sideslip_angle=radians(beta), altitude=PUBLISHED_ALTITUDE
    )


EXAMPLES = {
    "m5_a6_b5": condition(5.0, 6.0, 5.0),
    "m7_a2_b8": condition(7.0, 2.0, 8.0),
    "m5_a6_b6": condition(5.0, 6.0, 6.0),
    "m6_a0_b5": condition(6.0, 0.0, 5.0),
}
"""The conditions of the source's figures of fields."""

P1, P2 = condition_set("P1"), condition_set("P2")

TESTS = ConditionSet("examples", tuple(EXAMPLES.values()))

HELD_OUT = ConditionSet(
    "held out",
    tuple(condition_grid([5.25, 5.75, 6.25, 6.75], [1.0, 3.0, 5.0, 7.0, 9.0], [2.5, 7.5], PUBLISHED_ALTITUDE)),
)
"""Between the conditions of P1 in Mach number, incidence and sideslip: none of their flows is in P1 or P2."""


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """Resolution of all models of a run.

    Attributes
    ----------
    scheduling : of the flows; coarse flows are solved faster than processes start.
    surface_stations, surface_roll_angles : of the pressure nodes, about their product.
    flow_grid, held_out_grid : level of the flow's grid, of the snapshots and of the held-out flows.
    hexahedra : of the converged model.
    tetrahedra : hexahedra of the tetrahedral model, before they are cut.
    fourier_element_mm, fourier_layers, fourier_harmonics : of the independent model.
    """

    name: str
    scheduling: Scheduling
    surface_stations: int
    surface_roll_angles: int
    flow_grid: str
    held_out_grid: str
    hexahedra: SweptResolution
    tetrahedra: SweptResolution
    fourier_element_mm: float
    fourier_layers: int
    fourier_harmonics: int


PAPER = Sizes(
    name="paper",
    scheduling=Scheduling(),
    surface_stations=504,
    surface_roll_angles=120,
    flow_grid="medium",
    held_out_grid="fine",
    hexahedra=RESOLUTIONS["paper"],
    tetrahedra=SweptResolution(0.00995, 1, 192),
    fourier_element_mm=6.0,
    fourier_layers=3,
    fourier_harmonics=24,
)
"""60,480 pressure nodes and, of linear tetrahedra, 461,952 dofs where the source has 60,538 and 461,664.

The source's 153,888 nodes of linear tetrahedra, on the shipped vehicle, are edges of about 6.5 mm and one element
through the wall of 4 mm.
"""

QUICK = Sizes(
    name="quick",
    scheduling=Scheduling(workers=0),
    surface_stations=120,
    surface_roll_angles=72,
    flow_grid="coarse",
    held_out_grid="medium",
    hexahedra=RESOLUTIONS["coarse"],
    tetrahedra=SweptResolution(0.020, 1, 96),
    fourier_element_mm=12.0,
    fourier_layers=2,
    fourier_harmonics=16,
)
"""The same protocol on coarse grids: a quick run, whose numbers are not converged."""


def sized(vehicle: Vehicle, sizes: Sizes) -> Vehicle:
    """Return the vehicle with the pressure nodes and the Fourier model of ``sizes``."""
    of_map = vehicle.resolution.map
    resolution = Resolution(
        radial_cells=of_map.radial_cells,
        circumferential_cells=of_map.circumferential_cells,
        surface_stations=sizes.surface_stations,
        surface_roll_angles=sizes.surface_roll_angles,
        harmonics=sizes.fourier_harmonics,
        element_length_mm=sizes.fourier_element_mm,
        wall_layers=sizes.fourier_layers,
    )
    return vehicle.model_copy(update={"resolution": vehicle.resolution.model_copy(update={"map": resolution})})
