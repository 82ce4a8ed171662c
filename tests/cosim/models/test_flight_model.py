"""The plant's physics against the formulas written out one by one."""

from dataclasses import replace
from math import atan2, cos, pi, radians, sin
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic_vehicle import synthetic_flight_model

from strainfmu.atmosphere import dynamic_pressure, pressure_and_temperature
from strainfmu.cosim.models.flight_model import evaluate, load_flight_model, save_flight_model
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

pytestmark = pytest.mark.fast


def polynomial(table: np.ndarray, mach_step: float, incidence_step: float) -> np.ndarray:
    """Return sum_pq c[p, q] dM^p da^q, term by term."""
    return sum(table[p, q] * mach_step**p * incidence_step**q for p in range(4) for q in range(4))


@pytest.mark.parametrize("internal_pressure", [None, 9e4])
def test_evaluate_is_the_stated_formula(internal_pressure: float | None) -> None:
    model = replace(synthetic_flight_model(), internal_pressure=internal_pressure)
    mach, alpha, beta, altitude = 6.3, radians(4.0), radians(-5.0), 21e3
    incidence = np.arccos(cos(alpha) * cos(beta))
    roll = atan2(-sin(beta), sin(alpha) * cos(beta))
    # Mach 6.3 lies in the third cell (from 6), 6.4 deg in the second (from 3 deg).
    steps = (mach - 6.0, incidence - radians(3.0))
    pressure = pressure_and_temperature(altitude)[0]
    inside = pressure if internal_pressure is None else internal_pressure
    expected_strain = []
    for gauge, channel, uniform in zip(
        model.gauge_roll_angle, model.gauge_channel, model.strain_of_internal_pressure, strict=True
    ):
        harmonics = polynomial(model.strain_table[2, 1, :, :, channel], *steps)
        expected_strain.append(
            pressure
            * sum(e * cos(m * (gauge - roll)) + s * sin(m * (gauge - roll)) for m, (e, s) in enumerate(harmonics))
            - inside * uniform
        )
    axial, cross_force, moment = polynomial(model.coefficient_table[2, 1], *steps)
    q = dynamic_pressure(mach, altitude)
    expected = [
        axial - inside * 0.1 / (q * 0.2),
        cross_force * cos(roll),
        cross_force * sin(roll),
        moment * cos(roll),
        moment * sin(roll),
    ]

    point = evaluate(
        model, FlightCondition(mach_number=mach, angle_of_attack=alpha, sideslip_angle=beta, altitude=altitude)
    )

    np.testing.assert_allclose(point.strain, expected_strain, rtol=1e-10)
    np.testing.assert_allclose(point.coefficients, expected, rtol=1e-10)
    assert point.dynamic_pressure == pytest.approx(dynamic_pressure(mach, altitude), rel=1e-14)


@pytest.mark.parametrize(
    ("alpha", "beta", "roll"), [(0.1, 0.0, 0.0), (-0.1, 0.0, pi), (0.0, 0.1, -pi / 2), (0.0, -0.1, pi / 2)]
)
def test_the_leeward_meridian_is_where_the_wind_goes(alpha: float, beta: float, roll: float) -> None:
    condition = FlightCondition(mach_number=6.0, angle_of_attack=alpha, sideslip_angle=beta, altitude=2e4)
    assert condition.total_incidence == pytest.approx(0.1, rel=1e-14)
    assert cos(condition.leeward_roll_angle - roll) == pytest.approx(1.0, abs=1e-14)


def test_incidence_keeps_its_digits_near_zero() -> None:
    assert FlightCondition(
        mach_number=6.0, angle_of_attack=3e-9, sideslip_angle=4e-9, altitude=2e4
    ).total_incidence == pytest.approx(5e-9, rel=1e-12)


def test_both_ends_of_the_envelope_are_inside() -> None:
    model = synthetic_flight_model()
    for mach in (5.0, 7.0, 7.0 + 1e-12):
        for alpha in (0.0, radians(12.0), -radians(12.0)):
            assert np.all(
                np.isfinite(
                    evaluate(
                        model,
                        FlightCondition(mach_number=mach, angle_of_attack=alpha, sideslip_angle=0.0, altitude=0.0),
                    ).strain
                )
            )


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ((4.9, 0.0, 0.0, 2e4), ("mach_number: 4.9 found at time 1.5 s", "5 to 7 allowed")),
        (
            (6.0, radians(12.1), 0.0, 2e4),
            ("total incidence: 12.1 deg found at time 1.5 s", "0 to 12 deg allowed"),
        ),
        ((6.0, 0.0, 0.0, 72e3), ("altitude: 72000 m found", "0 to 71000 m allowed at time 1.5 s")),
        ((float("nan"), 0.0, 0.0, 2e4), ("mach_number: nan found",)),
    ],
)
def test_outside_the_envelope_is_refused(condition: tuple[float, ...], words: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as error:
        evaluate(synthetic_flight_model(), FlightCondition(*condition), time=1.5)
    for word in words:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


def test_save_and_load_give_the_same_model(tmp_path: Path) -> None:
    model = synthetic_flight_model()
    save_flight_model(model, tmp_path / "model.h5")
    loaded = load_flight_model(tmp_path / "model.h5")
    assert loaded.gauge_names == model.gauge_names
    assert loaded.provenance == model.provenance
    assert loaded.noise_std == model.noise_std
    for name in ("gauge_roll_angle", "gauge_channel", "mach_knots", "strain_table", "coefficient_table"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(model, name))


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.h5"
    with pytest.raises(InputError, match="no such file"):
        load_flight_model(path)
    save_flight_model(synthetic_flight_model(), path)
    with h5py.File(path, "r+") as file:
        file["mach_knots"][0] = 4.0
    with pytest.raises(InputError, match="damaged or altered"):
        load_flight_model(path)
    path.write_bytes(b"no HDF5")
    with pytest.raises(InputError, match="not an HDF5 file"):
        load_flight_model(path)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"gauge_roll_angle": np.zeros(2)}, r"gauge_roll_angle has shape \(2,\), must be \(6,\)"),
        ({"mach_knots": np.array([5.0, 5.0, 6.0, 7.0])}, "mach_knots must increase"),
        ({"incidence_knots": np.array([0.1, 0.2, 0.3])}, "starts at 0.1 rad, must be 0"),
        ({"incidence_knots": np.array([0.0])}, "at least 2 x 2"),
        ({"gauge_channel": np.full(6, 2)}, "integers from 0 to 1"),
        ({"gauge_names": ("a",) * 6}, "a name twice"),
        ({"noise_std": -1.0}, "noise_std is -1.0"),
        ({"reference_area": 0.0}, "reference_area is 0.0, must be positive"),
        ({"coefficient_table": np.full((3, 2, 4, 4, 3), np.nan)}, "not finite"),
        ({"strain_table": np.zeros((3, 2))}, "2 axes, must have 7"),
    ],
)
def test_values_that_cannot_be_meant_are_refused(changes: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(synthetic_flight_model(), **changes)
