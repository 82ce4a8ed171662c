"""Viscous pressure and friction beside closed forms, and what a map makes of them."""

from __future__ import annotations

import numpy as np

from builder.stress.kinds import all_kinds
from builder.stress.model import RevolvedModel
from builder.stress.score import Range
from builder.stress.viscous_kinds import OVERPRESSURE, Friction, Raised
from builder.truth.revolution.strain import true_structure
from strainfmu.flight_condition import FlightCondition

AT = FlightCondition(mach_number=6.0, angle_of_attack=0.05, sideslip_angle=0.0, altitude=20e3)


def test_even_pressure_pushes_on_the_base_area(trial: Range) -> None:
    assert isinstance(trial.model, RevolvedModel)
    kind = next(one for one in all_kinds(trial.vehicle) if one.error == "viscous pressure")
    raised = Raised(size=OVERPRESSURE).on_table(trial.vehicle, trial.model.table)
    np.testing.assert_allclose(raised.harmonic[..., 0] - trial.model.table.harmonic[..., 0], OVERPRESSURE)
    ordinary = next(one for one in all_kinds(trial.vehicle) if one.error == "nothing wrong")
    found, without = (trial.model.flights(one, 5, np.random.default_rng(1)) for one in (kind, ordinary))
    base = np.pi * float(trial.model.structure.surface.radius[-1]) ** 2
    pressure = OVERPRESSURE * np.array([one.ambient_pressure for one in found.conditions])
    expected = pressure * base / (found.dynamic_pressure * trial.vehicle.reference_quantities().area)
    np.testing.assert_allclose(found.coefficients[:, 0] - without.coefficients[:, 0], expected, rtol=1e-3)


def test_friction_presses_each_section_by_what_lies_ahead(trial: Range) -> None:
    """Axial strain -T(x) / (2 pi r t E) of a thin tube, T the friction ahead of x; within 3 %."""
    vehicle, structure = trial.vehicle, true_structure(trial.vehicle)
    friction, surface, placed = Friction(vehicle=vehicle, size=0.01), structure.surface, structure.placed
    strain = friction.strain([AT])[0]
    area = np.pi * (surface.radius[1:] + surface.radius[:-1])
    area = np.cumsum(area * np.hypot(np.diff(surface.x), np.diff(surface.radius)))
    total = 0.01 * AT.dynamic_pressure * vehicle.reference_quantities().area
    ahead = total * np.interp(placed.x, surface.x[1:], area) / area[-1]
    thickness, modulus = 1e-3 * vehicle.structure.wall_thickness_mm, 1e9 * vehicle.material.youngs_modulus_GPa
    middle = np.interp(placed.x, surface.x, surface.radius) - 0.5 * thickness
    expected = -ahead / (2.0 * np.pi * middle * thickness * modulus)
    away = (placed.meridional > 0.99) & (placed.x > 1.0) & (placed.x < 3.0)
    np.testing.assert_allclose(strain[away], expected[away], rtol=0.03)


def test_friction_is_no_part_of_the_axial_coefficient(trial: Range) -> None:
    kind = next(one for one in all_kinds(trial.vehicle) if one.error == "friction")
    assert trial.score(kind).missed == ()
