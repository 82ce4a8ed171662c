"""The strain of a vehicle as built against the models that it joins."""

from dataclasses import replace

import numpy as np
import pytest
from as_built_case import LAYOUT, TITANIUM

from builder.inverse.noise.hardware_errors import strain_derivatives
from builder.structure.as_built.as_built_structure import AsBuiltStructure, as_built_structure
from builder.structure.as_built.as_built_vehicle import (
    AsBuilt,
    as_built_std,
    draw_as_built,
    parameter_derivatives,
    parameter_names,
)
from builder.structure.as_built.response_tables import together
from builder.structure.fourier.fourier_model import StructuralModel
from builder.structure.loads.applied import ApparentStrain, Load, PadForce, SurfacePressure, Weight
from builder.structure.loads.gauge_strain import gauge_strain
from builder.structure.loads.of_vehicle import fourier_structure_of
from builder.structure.loads.temperature import uniform_temperature
from builder.vehicle.file import Vehicle
from builder.vehicle.structure_section import Temperature
from strainfmu.errors import InputError

LOADS: tuple[Load, ...] = (
    PadForce(station=1.0, roll_angle=0.3, half_length=0.15, half_angle=0.9, force=(0.0, 300.0, -1500.0)),
    Weight(up_roll_angle=1.0),
    SurfacePressure(surface="inner", pressure=1e5),
)


@pytest.fixture(scope="module")
def errors(vehicle: Vehicle, as_built: AsBuiltStructure) -> AsBuilt:
    std = as_built_std(vehicle.calibration, as_built.counts)
    return draw_as_built(std, np.random.default_rng(4))


@pytest.mark.fast
def test_without_errors_it_is_the_structure_of_the_map(
    vehicle: Vehicle, as_built: AsBuiltStructure, structure: StructuralModel
) -> None:
    nominal = as_built.exactly_built()
    z_p = structure.strain_operator(LAYOUT)
    np.testing.assert_allclose(as_built.strain_operator(nominal), z_p, atol=1e-12 * np.abs(z_p).max())
    loaded = fourier_structure_of(vehicle, LAYOUT, properties=TITANIUM, max_harmonic=12)
    for load in LOADS:
        expected = gauge_strain(loaded, [load])
        found = as_built.load_strain(nominal, [load])
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def test_harmonics_beyond_what_changes_need_leave_the_strain(
    vehicle: Vehicle, as_built: AsBuiltStructure, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a wall that differs by 3 % everywhere, under a pad that needs all twelve harmonics."""
    changed = as_built.states.changes.n_changed
    assert changed < len(as_built.states.nominal.outer)
    monkeypatch.setattr("builder.structure.as_built.as_built_structure.changed_harmonic_of", max)
    whole = as_built_structure(vehicle, LAYOUT, properties=TITANIUM, max_harmonic=12)
    assert whole.states.changes.n_changed > changed
    pad = PadForce(station=1.0, roll_angle=0.3, half_length=0.05, half_angle=np.pi / 6, force=(0.0, 0.0, -1500.0))
    sign = np.resize([0.03, -0.03], as_built.n_regions)
    for kind in ("wall_thickness", "wall_taper", "wall_cosine", "wall_second_sine"):
        built = as_built.exactly_built().changed(**{kind: sign})
        found, expected = (one.load_strain(built, [pad]) for one in (as_built, whole))
        unchanged = whole.load_strain(whole.exactly_built(), [pad])
        largest = np.abs(unchanged).max()
        assert 0.0 < np.abs(found - expected).max() < 5e-5 * largest
        assert np.abs(expected - unchanged).max() > 1e-3 * largest


def test_gauges_move_as_the_derivatives_of_the_map_say(
    vehicle: Vehicle, as_built: AsBuiltStructure, structure: StructuralModel
) -> None:
    nominal, step = as_built.exactly_built(), 1e-4
    keys = [(kind, 0) for kind in ("axial_shift", "circumferential_shift", "orientation")]
    for (kind, _), expected in strain_derivatives(vehicle, structure, LAYOUT, keys).items():
        plus, minus = (
            as_built.strain_operator(nominal.changed(**{kind: np.full(as_built.n_gauges, sign * step)}))
            for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose((plus - minus) / (2.0 * step), expected, atol=1e-5 * np.abs(expected).max())


def test_a_warm_vehicle_reads_its_expansion_less_what_gauges_cancel(
    vehicle: Vehicle, as_built: AsBuiltStructure
) -> None:
    entry = Temperature(
        expansion_um_per_m_per_K=9.0, compensation_um_per_m_per_K=8.0, apparent_strain_um_per_m=(0.2, -0.001)
    )
    warm, load = vehicle.model_copy(update={"temperature": entry}), uniform_temperature(5.0)
    structure = as_built_structure(warm, LAYOUT, max_harmonic=2, known_thickness=np.zeros(as_built.n_regions))
    expansion = gauge_strain(fourier_structure_of(warm, LAYOUT, max_harmonic=2), [load])
    found = structure.reading(structure.exactly_built(), [load])
    np.testing.assert_allclose(found, expansion + 1e-6 * (0.2 * 5.0 - 0.001 * 25.0), atol=1e-12)
    assert np.median(found) == pytest.approx(1e-6 * (5.0 + 0.975), rel=0.05)
    with pytest.raises(InputError, match=r"temperature\.expansion_um_per_m_per_K"):
        as_built.response(load)


@pytest.mark.slow
def test_tables_follow_the_thickness_that_is_solved_for(
    vehicle: Vehicle, as_built: AsBuiltStructure, errors: AsBuilt
) -> None:
    taper = np.array([0.02, -0.03, 0.01, 0.02])
    even = as_built.exactly_built().changed(wall_thickness=errors.wall_thickness, wall_taper=taper)
    known = as_built_structure(
        vehicle,
        LAYOUT,
        properties=TITANIUM,
        known_thickness=even.wall_thickness,
        known_taper=taper,
        max_harmonic=12,
    )
    for load in LOADS:
        nominal = as_built.load_strain(as_built.exactly_built(), [load])
        expected, found = known.load_strain(even, [load]), as_built.load_strain(even, [load])
        assert np.abs(found - expected).max() < 0.03 * np.abs(expected - nominal).max()
    responses = [known.response(load) for load in LOADS]
    alone = [known.response_strain(even, one) for one in responses]
    np.testing.assert_allclose(known.response_strain(even, together(responses)), alone, rtol=1e-12, atol=1e-18)
    with pytest.raises(InputError, match="solved for one wall"):
        known.load_strain(as_built.exactly_built(), [LOADS[0]])


@pytest.mark.parametrize(("kind", "wave"), [("wall", 1), ("wall_second", 2)])
def test_an_uneven_wall_rolls_with_the_vehicle(as_built: AsBuiltStructure, kind: str, wave: int) -> None:
    """Thickness as the sine, load and gauges rolled by a quarter of its period: the same as by the cosine."""
    nominal, angle = as_built.exactly_built(), 0.5 * np.pi / wave
    size = np.full(as_built.n_regions, 0.02)
    pad = LOADS[0]
    assert isinstance(pad, PadForce)
    _, across, up = pad.force
    c, s = np.cos(angle), np.sin(angle)
    turned = replace(pad, roll_angle=pad.roll_angle + angle, force=(0.0, c * across + s * up, c * up - s * across))
    cosine = nominal.changed(**{f"{kind}_cosine": size})
    sine = nominal.changed(**{f"{kind}_sine": size}, layout_roll=np.array([angle]))
    rolled = Weight(up_roll_angle=1.0 + angle)
    for one, other in ((pad, turned), (LOADS[1], rolled)):
        by_cosine, by_sine = as_built.load_strain(cosine, [one]), as_built.load_strain(sine, [other])
        np.testing.assert_allclose(by_sine, by_cosine, atol=1e-9 * np.abs(by_cosine).max())
    grid = len(as_built.surface.x), as_built.surface.n_roll
    z_cosine, z_sine = (as_built.strain_operator(one).reshape(-1, *grid) for one in (cosine, sine))
    np.testing.assert_allclose(
        np.roll(z_cosine, grid[1] // (4 * wave), axis=2), z_sine, atol=1e-9 * np.abs(z_cosine).max()
    )


@pytest.mark.fast
def test_gains_zeros_and_stiffness(as_built: AsBuiltStructure) -> None:
    nominal, n_d = as_built.exactly_built(), as_built.n_gauges
    plain = as_built.load_strain(nominal, LOADS)
    changed = nominal.changed(
        gauge_gain=np.full(n_d, 0.02),
        common_gain=np.array([0.01]),
        youngs_modulus=np.array([0.03]),
        zero=np.full(n_d, 5e-5),
    )
    np.testing.assert_allclose(as_built.reading(changed, LOADS), plain * 1.02 * 1.01 / 1.03 + 5e-5, rtol=1e-12)


@pytest.mark.fast
def test_parameters_pack_into_a_vector(as_built: AsBuiltStructure, errors: AsBuilt) -> None:
    names = parameter_names(as_built.gauges.names, as_built.counts)
    assert len(names) == len(set(names)) == len(errors.vector)
    np.testing.assert_array_equal(errors.of_vector(errors.vector).vector, errors.vector)
    assert names[list(errors.vector).index(errors.wall_sine[1])] == "wall sine region 2"
    with pytest.raises(InputError, match=r"gauge_gain: expected|zero: expected"):
        errors.changed(zero=np.zeros(3))


def test_loads_together_read_as_each_alone(as_built: AsBuiltStructure, errors: AsBuilt) -> None:
    """Loads of other numbers of harmonics, with forces in the wall and without, and one that no stress makes."""
    apparent = ApparentStrain(strain=1e-6 * np.arange(as_built.n_gauges))
    responses = [as_built.response(load) for load in (*LOADS, apparent)]
    responses.append(replace(responses[0], by_stress=False))
    alone = np.array([as_built.response_strain(errors, one) for one in responses])
    found = as_built.response_strain(errors, together(responses))
    np.testing.assert_allclose(found, alone, rtol=1e-12, atol=1e-18)


def test_closed_derivatives_are_those_of_differences(as_built: AsBuiltStructure, errors: AsBuilt) -> None:
    random, n_r = np.random.default_rng(8), as_built.n_regions
    built = errors.changed(
        wall_taper=0.01 * random.standard_normal(n_r),
        wall_second_cosine=0.01 * random.standard_normal(n_r),
        row_orientation=0.02 * random.standard_normal(as_built.counts.row),
        clamp_axial=0.01,
        mass=0.03,
    )
    responses = together([as_built.response(load) for load in LOADS])
    keys = as_built.solved_keys
    value, slopes = as_built.response_slopes(built, responses, keys)
    np.testing.assert_allclose(value.T, as_built.response_strain(built, responses), rtol=1e-12)
    expected = parameter_derivatives(lambda one: as_built.response_strain(one, responses).T, built, keys)
    for key in keys:
        scale = max(float(np.abs(expected[key]).max()), 1e-12)
        np.testing.assert_allclose(slopes[key], expected[key], atol=1e-5 * scale, err_msg=str(key))


def test_closed_derivatives_of_the_operator_are_those_of_differences(
    as_built: AsBuiltStructure, errors: AsBuilt
) -> None:
    keys = as_built.solved_keys
    slopes = as_built.operator_slopes(errors, keys)
    field = np.random.default_rng(9).standard_normal(as_built.surface.n_nodes)
    expected = parameter_derivatives(lambda one: as_built.strain_operator(one) @ field, errors, keys)
    for key in keys:
        scale = max(float(np.abs(expected[key]).max()), 1e-15)
        np.testing.assert_allclose(slopes[key] @ field, expected[key], atol=1e-3 * scale, err_msg=str(key))
