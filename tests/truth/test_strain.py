"""The independent model of a body of revolution: its table of pressure, exact where it must be, closed outside its
knots; strain and coefficients against the operators of a structure solved for each error on the pressure."""

from dataclasses import replace
from math import asin, atan2, cos, radians, sin
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from coarse_vehicle import true_flights
from ensembles import listed_ensemble
from trial_cases import with_entries

from builder.aero.load_operator import coefficients_of, load_operator
from builder.inverse.noise.hardware_errors import HardwareError, hardware_errors
from builder.structure.as_built.as_built_vehicle import AsBuilt, Counts, exactly_built
from builder.structure.as_built.wall_regions import counts_of
from builder.structure.as_built_kinds import IN_FLIGHT, IN_NOISE
from builder.structure.fourier.fourier_model import structural_model
from builder.trial.conditions import quantities
from builder.truth.flights import drawn_vehicle
from builder.truth.flow_table import (
    FlowTable,
    harmonics_at,
    load_flow_table,
    save_flow_table,
    truth_surface,
)
from builder.truth.true_structure import TrueFlights, TrueStructure, true_structure
from builder.vehicle.file import VEHICLES, Vehicle, load_vehicle
from builder.vehicle.map_options import Noise
from strainfmu.arrays import FloatArray
from strainfmu.errors import FlowReachError, InputError
from strainfmu.flight_condition import FlightCondition

N_GAUGES = 54


def condition_at(incidence_deg: float, roll: float, mach: float = 6.2, altitude: float = 18e3) -> FlightCondition:
    """Return the condition of a total incidence [deg] with the leeward meridian at ``roll`` [rad]."""
    total = radians(incidence_deg)
    alpha, beta = atan2(sin(total) * cos(roll), cos(total)), -asin(sin(total) * sin(roll))
    return FlightCondition(mach, alpha, beta, altitude)


CONDITIONS = [
    condition_at(0.0, 0.0),
    condition_at(6.5, 0.4),
    condition_at(11.0, -2.2, 5.4, 24e3),
    condition_at(8.0, 1.9, 6.7, 14e3),
]
INSIDE = np.array([[one.ambient_pressure] for one in CONDITIONS])


class Flown(NamedTuple):
    """The coarse vehicle of the independent model; (k, n_p) ``pressure`` of the flights at its nodes [Pa]."""

    vehicle: Vehicle
    model: TrueStructure
    table: FlowTable
    flights: TrueFlights
    pressure: FloatArray

    @property
    def operator(self) -> FloatArray:
        """Z_p of the structure that flies."""
        layout = self.vehicle.gauges.layout
        return structural_model(self.vehicle, self.vehicle.resolution.truth, [layout]).strain_operator(layout)

    def columns(self, noise: Noise) -> list[HardwareError]:
        """Return the errors of strain that a map includes for ``noise``."""
        model = structural_model(self.vehicle, self.vehicle.resolution.map, [self.vehicle.gauges.layout])
        operator = model.strain_operator(self.vehicle.gauges.layout)
        stated = self.vehicle.model_copy(update={"noise": noise})
        return hardware_errors(stated, model, operator, listed_ensemble(self.pressure - INSIDE))


@pytest.fixture(scope="module")
def flown(vehicle: Vehicle, true_model: TrueStructure, table: FlowTable) -> Flown:
    mach, incidence = (quantities(CONDITIONS, name) for name in ("mach_number", "total_incidence"))
    harmonic, roll, fields = harmonics_at(table, mach, incidence), true_model.surface.roll_angle, []
    for one, of_flow in zip(CONDITIONS, harmonic, strict=True):
        phase = np.outer(np.arange(harmonic.shape[2]), roll - one.leeward_roll_angle)
        fields.append(one.ambient_pressure * (of_flow @ np.cos(phase)).ravel())
    flights = true_flights(vehicle, true_model, table, CONDITIONS)
    return Flown(vehicle, true_model, table, flights, np.array(fields))


def built(**errors: Any) -> AsBuilt:
    return exactly_built(N_GAUGES).changed(**errors)


def close(found: FloatArray, expected: FloatArray, tolerance: float = 1e-10) -> None:
    """Assert that strains agree to ``tolerance`` of the largest."""
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * np.abs(expected).max())


@pytest.mark.parametrize("inside", ["ambient", 2e4])
def test_coefficients_are_the_loads_of_the_pressure(inside: Any, flown: Flown) -> None:
    """C and strain of the same pressure by the operators of loads and strain: 1e-10 of the largest."""
    vehicle = with_entries(flown.vehicle, "structure", internal_pressure_Pa=inside)
    found = true_flights(vehicle, flown.model, flown.table, CONDITIONS)
    reference, net = vehicle.reference_quantities(), flown.pressure - (INSIDE if inside == "ambient" else inside)
    loads = load_operator(flown.model.surface, reference.moment_station)
    expected = coefficients_of(net, loads, CONDITIONS, reference)
    for coefficient, wanted in zip(found.coefficients.T, expected.T, strict=True):
        close(coefficient, wanted)
    close(found.read(built()), net @ flown.operator.T)


def test_turned_layouts_and_gauges_read_what_others_do(flown: Flown) -> None:
    """A layout turned by 20 deg what it reads with the wind turned back, gauges turned by 90 deg the other one."""
    turn, layout = radians(20.0), flown.vehicle.gauges.layout
    ahead, behind = (
        true_flights(flown.vehicle, flown.model, flown.table, [condition_at(9.0, roll)])
        for roll in (0.5, 0.5 - turn)
    )
    close(ahead.read(built(layout_roll=turn)), behind.read(built()))
    names = structural_model(flown.vehicle, flown.vehicle.resolution.truth, [layout]).layouts[layout].names
    axial, hoop = ([names.index(f"{way}_180deg_{i}") for i in range(1, 10)] for way in ("axial", "hoop"))
    straight = flown.flights.read(built())
    turned = flown.flights.read(built(orientation=np.full(N_GAUGES, np.pi / 2.0)))
    close(turned[:, axial], straight[:, hoop])
    close(turned[:, hoop], straight[:, axial])


def test_gains_apparent_strain_and_internal_pressure_by_the_book(flown: Flown) -> None:
    read, straight = flown.flights.read, flown.flights.read(built())
    gain, apparent = 0.01 * np.random.default_rng(1).standard_normal(N_GAUGES), np.full(N_GAUGES, 5e-6)
    close(read(built(gauge_gain=gain, common_gain=0.02)), straight * (1.0 + gain) * 1.02, 1e-14)
    close(read(built(apparent_strain=apparent)), straight + apparent, 1e-14)
    ambient = flown.flights.ambient_pressure
    close(read(built(internal_pressure=0.05)), straight - 0.05 * np.outer(ambient, flown.operator.sum(axis=1)))
    # 5 % of p_inf more inside, on a wall as built: the strain of that pressure alone.
    one = drawn_vehicle(Noise(std_um_per_m=0.4), N_GAUGES, np.random.default_rng(8))
    more = read(one.changed(internal_pressure=one.internal_pressure + 0.05)) - read(one)
    of_unit = (1.0 + one.gauge_gain) * (1.0 + one.common_gain) * flown.model.parts(one).even[:, 0].sum(axis=0)
    close(more, -0.05 * np.outer(ambient, of_unit), 1e-8)


@pytest.mark.fast
def test_a_vehicle_is_drawn_at_the_stated_sizes() -> None:
    """Root mean square over 400 vehicles of 50 gauges: within 12 % (3 sigma of 400 draws), scale included."""
    entry, random = Noise(std_um_per_m=0.4, internal_pressure_percent=7.0), np.random.default_rng(5)
    vehicles = [drawn_vehicle(entry, 50, random, scale=2.0) for _ in range(400)]
    sizes = {"gauge_gain": 0.01, "axial_shift": 1e-3, "orientation": radians(1.0), "internal_pressure": 0.07}
    kinds = {kind.name: kind for kind in IN_NOISE if kind.std(entry) > 0.0}
    assert {name: kinds[name].std(entry) for name in sizes} == pytest.approx(sizes)
    for kind in kinds.values():
        values = np.array([getattr(one, kind.name) for one in vehicles])
        assert np.sqrt(np.mean(values**2)) == pytest.approx(2.0 * kind.std(entry), rel=0.12), kind.name
    assert np.ptp(vehicles[0].apparent_strain) == 0.0
    assert np.ptp(vehicles[0].gauge_gain) > 0.0
    none = drawn_vehicle(entry.without_hardware_errors(), 50, random)
    assert not any(value.any() for value in none.errors.values())


BY_REGION = {
    "row_orientation_deg": 1.0,
    "wall_harmonic_percent": 1.0,
    "wall_taper_percent": 1.0,
    "wall_second_harmonic_percent": 1.0,
    "region_modulus_percent": 1.0,
    "joint_softness_mm": 2.0,
}
CLAMP = {"clamp_compliance_mm": 2.0}


def with_joint(flown: Flown, alone: bool, entries: dict[str, float]) -> Vehicle:
    """Return the vehicle with other errors, ``alone`` or with the default ones; a joint where it yields."""
    own, calibration = flown.vehicle.noise, flown.vehicle.calibration
    noise = (own.without_hardware_errors() if alone else own).model_copy(update=entries)
    if "joint_softness_mm" in entries:
        calibration = calibration.model_copy(update={"joint_stations_m": (1.2,)})
    return flown.vehicle.model_copy(update={"noise": noise, "calibration": calibration})


@pytest.mark.parametrize(
    ("alone", "entries", "tolerance"),
    [(False, {"transverse_sensitivity_percent": 1.0}, 3e-3), (True, CLAMP, 3e-3), (True, BY_REGION, 0.03)],
    ids=["hardware", "clamp", "by region, row and joint"],
)
def test_error_columns_predict_vehicles_built_so(
    alone: bool, entries: dict[str, float], tolerance: float, flown: Flown
) -> None:
    """One standard deviation of each error, gauges of random signs: change of strain, in norm; of gains 1e-9."""
    vehicle = with_joint(flown, alone, entries)
    structure = true_structure(vehicle)
    flights, found = true_flights(vehicle, structure, flown.table, CONDITIONS), flown._replace(vehicle=vehicle)
    exact = exactly_built(structure.counts)
    kinds = [kind for kind in IN_NOISE if kind not in IN_FLIGHT and kind.std(vehicle.noise) > 0.0]
    of_gauges = [(kind, None) for kind in kinds if kind.extent == "gauge"]
    common = [kind for kind in kinds if kind.extent != "gauge"]
    keys = [*of_gauges, *((kind, k) for kind in common for k in range(structure.counts.in_flight(kind)))]
    # Next to the slope break strain bends within a step of any size.
    away = (np.abs(flown.model.placed.x - 1.75) > 0.1) | (tolerance > 0.01)
    for error, (kind, k) in zip(found.columns(vehicle.noise), keys, strict=True):
        assert (error.name, error.common) == (kind.column_name, k is not None)
        sign = np.random.default_rng(3).choice([-1.0, 1.0], N_GAUGES) if k is None else np.ones(N_GAUGES)
        size = kind.std(vehicle.noise) * (sign if k is None else np.eye(structure.counts.in_flight(kind))[k])
        above, below = (flights.read(exact.changed(**{kind.name: way * size})) for way in (1.0, -1.0))
        change = 0.5 * (above - below)[:, away]  # without what is of second order
        off = np.linalg.norm((sign * error.strain)[:, away] - change)
        assert off < (tolerance if kind.step else 1e-9) * np.linalg.norm(change), (kind.name, k)


def test_many_vehicles_at_once_are_those_one_by_one(flown: Flown) -> None:
    """Every flight alone with 3 vehicles of all errors, of gauges and by region: 1e-12 of the largest strain."""
    vehicle = with_joint(flown, False, BY_REGION | CLAMP)
    structure = true_structure(vehicle)
    assert structure.counts == Counts(gauge=N_GAUGES, region=4, row=4, joint=1)
    flights = true_flights(vehicle, structure, flown.table, CONDITIONS)
    many = drawn_vehicle(vehicle.noise, structure.counts, np.random.default_rng(7), count=3)
    for number in range(len(CONDITIONS)):
        read = flights.read(many, slice(number, number + 1))
        for vehicle_number in range(3):
            close(read[vehicle_number], flights.read(many.one_of(vehicle_number))[number], 1e-12)


def test_errors_that_a_structure_has_not_are_refused_and_draws_of_others_stay(flown: Flown) -> None:
    other = with_joint(flown, False, BY_REGION | CLAMP)
    many, plain = (
        drawn_vehicle(of.noise, Counts(gauge=N_GAUGES, region=4, row=4, joint=1), np.random.default_rng(3))
        for of in (other, flown.vehicle)
    )
    np.testing.assert_array_equal(many.gauge_gain, plain.gauge_gain)
    assert 0.0 < abs(many.clamp_axial.item()) < 8e-3
    assert plain.clamp_axial.item() == plain.clamp_transverse.item() == 0.0
    with_noise = flown.vehicle.model_copy(update={"noise": other.noise})
    with pytest.raises(InputError, match=r"joint_softness_mm: expected 0 without joints"):
        counts_of(with_noise, flown.model.placed.roll_angle, in_flight=True)
    with pytest.raises(InputError, match="clamp_compliance_mm is 0"):
        flown.flights.read(built(clamp_axial=1e-3))


MACH = np.array([5.0, 5.5, 6.2, 7.0])
INCIDENCE = np.array([0.05, 0.09, 0.16, 0.2])
N_X, N_M = 3, 5


def table_of(values: FloatArray) -> FlowTable:
    return FlowTable(vehicle="random", mach_knots=MACH, incidence_knots=INCIDENCE, harmonic=values, provenance={})


def random_table() -> FlowTable:
    return table_of(np.random.default_rng(1).standard_normal((len(MACH), len(INCIDENCE), N_X, N_M)))


def polynomial(mach: FloatArray, incidence: FloatArray) -> FloatArray:
    """Return (k, N_X, N_M) cubics in M; in a_T, 1 and a^2 for even harmonics, a and a^3 for odd ones."""
    random = np.random.default_rng(2)
    of_mach = random.standard_normal((4, N_X, N_M))
    in_mach = np.einsum("kp,pxm->kxm", (mach[:, None] - 6.0) ** np.arange(4), of_mach)
    first, second = random.standard_normal((2, N_X, N_M))
    a = incidence[:, None, None]
    odd = np.arange(N_M) % 2 == 1
    return in_mach * np.where(odd, first * a + second * a**3, first + second * a**2)


@pytest.mark.fast
def test_knots_and_cubics_between_them_are_met_from_zero_incidence_on() -> None:
    """At every knot the table's own harmonics; a cubic of the flow's symmetry is its own spline: 1e-12."""
    mach, incidence = (grid.ravel() for grid in np.meshgrid(MACH, INCIDENCE, indexing="ij"))
    table, values = random_table(), polynomial(mach, incidence)
    found = harmonics_at(table, mach, incidence)
    np.testing.assert_allclose(found, table.harmonic.reshape(-1, N_X, N_M), rtol=0.0, atol=1e-12)
    random = np.random.default_rng(3)
    at_mach, at_incidence = random.uniform(5.0, 7.0, 40), random.uniform(0.0, 0.2, 40)
    at_incidence[:5] = 0.0
    found = harmonics_at(table_of(values.reshape(table.harmonic.shape)), at_mach, at_incidence)
    np.testing.assert_allclose(found, polynomial(at_mach, at_incidence), rtol=0.0, atol=1e-12)


@pytest.mark.fast
@pytest.mark.parametrize(
    ("mach", "incidence", "message"),
    [
        (4.9, 0.1, "mach_number: 4.9 to 4.9 needed, the flows are of 5 to 7"),
        (6.0, 0.21, r"total incidence \[rad\]: 0.21 to 0.21 needed, the flows are of 0 to 0.2"),
        (np.nan, 0.1, "mach_number: nan to nan needed"),
    ],
)
def test_outside_the_knots_nothing_is_known(mach: float, incidence: float, message: str) -> None:
    with pytest.raises(FlowReachError, match=message):
        harmonics_at(random_table(), np.array([mach]), np.array([incidence]))


@pytest.mark.fast
def test_a_table_is_read_as_it_was_written_and_no_other(tmp_path: Path) -> None:
    """A blunt tip has more stations than the vehicle file states; flows with these stations are the vehicle's."""
    path, table = tmp_path / "flow.h5", random_table()
    with pytest.raises(InputError, match=r"expected shape \(4, 4, stations, harmonics\), got \(4, 4, 3\)"):
        replace(table, harmonic=table.harmonic[..., 0])
    with pytest.raises(InputError, match="harmonic: not all values are finite"):
        replace(table, harmonic=np.where(table.harmonic > 1.0, np.nan, table.harmonic))
    vehicle = load_vehicle(VEHICLES / "blunt_cone.toml")
    n_x, n_m = len(truth_surface(vehicle).x), vehicle.resolution.truth.harmonics + 1
    assert n_x > vehicle.resolution.truth.surface_stations
    for harmonics, name in ((n_m - 1, vehicle.name), (n_m, "")):
        save_flow_table(replace(table_of(np.zeros((4, 4, n_x, harmonics))), vehicle=name), path)
        with pytest.raises(InputError, match=f"expected flows of '{vehicle.name}' at .* got flows of '{name}'"):
            load_flow_table(path, vehicle)
    save_flow_table(replace(table_of(np.zeros((4, 4, n_x, n_m))), vehicle=vehicle.name), path)
    written = load_flow_table(path, vehicle)
    np.testing.assert_array_equal(written.mach_knots, table.mach_knots)
    assert written.harmonic.shape == (4, 4, n_x, n_m)
