"""The native plant against the numpy flight model, and its noise, faults, motion and states."""

from collections.abc import Iterator
from ctypes import byref, c_size_t, create_string_buffer
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmu_host import Host, loaded
from scipy.integrate import solve_ivp
from synthetic_vehicle import N_GAUGES, SyntheticFiles, synthetic_flight_model

from strainfmu.atmosphere import speed_of_sound
from strainfmu.cosim.models.flight_model import evaluate, save_flight_model
from strainfmu.cosim.models.gauge_noise import gauge_noise, quantile_table
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.flight_condition import FlightCondition
from strainfmu.fmu.plant_export import export_native_plant
from strainfmu.interface.plant_variables import FlightStart, GaugeFault, Motion

pytestmark = pytest.mark.fast

MODEL = replace(synthetic_flight_model(), apparent_strain=1e-6 * np.linspace(-3.0, 5.0, N_GAUGES))
START = FlightStart(mach_number=6.0, altitude=20e3, angle_of_attack=0.08, mass=2e4, pitch_inertia=3e5)
COEFFICIENTS = ["C_A", "C_N", "C_Y", "M_P", "M_Y"]
STRAINS = [f"strain[{i + 1}]" for i in range(N_GAUGES)]
CONDITION = ["mach_number", "angle_of_attack", "sideslip_angle", "altitude"]
STEP = 0.01


@pytest.fixture(scope="module")
def fmus(synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory) -> dict[Motion, Path]:
    """The plant of each motion."""
    folder = tmp_path_factory.mktemp("plants")
    save_flight_model(MODEL, folder / "flight_model.h5")
    made = {motion: folder / f"{motion.name}.fmu" for motion in Motion}
    for motion, path in made.items():
        trajectory = synthetic.trajectory if motion is Motion.TRAJECTORY else None
        export_native_plant(
            flight_model_path=folder / "flight_model.h5",
            fmu_path=path,
            motion=motion,
            start=START,
            trajectory_path=trajectory,
        )
    return made


def plant_of(fmus: dict[Motion, Path], motion: Motion, folder: Path) -> Iterator[Host]:
    with loaded(fmus[motion], folder / motion.name) as host:
        yield host


@pytest.fixture
def plant(fmus: dict[Motion, Path], tmp_path: Path) -> Iterator[Host]:
    """The plant whose flight condition is its input."""
    yield from plant_of(fmus, Motion.INPUTS, tmp_path)


@pytest.fixture
def flying(fmus: dict[Motion, Path], tmp_path: Path) -> Iterator[Host]:
    """The plant with short-period motion."""
    yield from plant_of(fmus, Motion.SHORT_PERIOD, tmp_path)


def set_fault(host: Host, gauge: int, kind: GaugeFault, value: float = 0.0) -> None:
    host.fmu.setInteger([host.references[f"fault_kind[{gauge}]"]], [int(kind)])
    host.set([f"fault_value[{gauge}]"], [value])


def assert_close(found: np.ndarray, expected: np.ndarray) -> None:
    # Relative to the vector: sums in another order differ by that much.
    assert np.linalg.norm(found - expected) <= 1e-12 * np.linalg.norm(expected)


def test_any_condition(plant: Host) -> None:
    plant.set(["noise_std"], [0.0])
    plant.initialize()
    random = np.random.default_rng(1)
    low, high = [5.0, -0.14, -0.14, 0.0], [7.0, 0.14, 0.14, 70e3]
    corners = [(5.0, 0.0, 0.0, 0.0), (7.0, 0.0, 0.14, 11e3), (5.5, -0.05, 0.0, 47e3), (6.0, 0.0, -0.1, 71e3)]
    for values in [*corners, *random.uniform(low, high, size=(300, 4)).tolist()]:
        plant.set(CONDITION, values)
        point = evaluate(MODEL, FlightCondition(*values))
        assert_close(plant.get(COEFFICIENTS), point.coefficients)
        assert_close(plant.get(STRAINS), point.strain)
        assert plant.get(["dynamic_pressure"])[0] == pytest.approx(point.dynamic_pressure, rel=1e-13)


def test_trajectory(fmus: dict[Motion, Path], synthetic: SyntheticFiles, tmp_path: Path) -> None:
    trajectory = load_trajectory(synthetic.trajectory)
    with loaded(fmus[Motion.TRAJECTORY], tmp_path / "x") as plant:
        plant.set(["noise_std"], [0.0])
        plant.initialize()
        for k in range(60):  # beyond the end, where the last condition stays
            point = evaluate(MODEL, trajectory.condition_at(k * STEP))
            assert_close(plant.get(CONDITION), np.array(trajectory.condition_at(k * STEP).as_tuple()))
            assert_close(plant.get(STRAINS), point.strain)
            plant.fmu.doStep(k * STEP, STEP)


@pytest.mark.parametrize("seed", [0, 1, 2**31 - 1])
def test_noise_is_that_of_the_reference(plant: Host, seed: int) -> None:
    plant.set(["noise_std"], [1.0])
    plant.fmu.setInteger([plant.references["seed"]], [seed])
    plant.initialize()
    strain = evaluate(
        MODEL,
        FlightCondition(mach_number=6.0, angle_of_attack=START.angle_of_attack, sideslip_angle=0.0, altitude=20e3),
    ).strain
    for sample in range(20):
        # Strains of 1e-5 beside noise of 1: what is left of the sum's round-off.
        np.testing.assert_allclose(plant.get(STRAINS), strain + gauge_noise(seed, sample, N_GAUGES), atol=1e-15)
        plant.fmu.doStep(sample * STEP, STEP)


def test_reference_noise_is_standard_normal() -> None:
    values = np.concatenate([gauge_noise(3, sample, 50) for sample in range(4000)])
    n = len(values)
    # Five standard errors of mean, variance, third and fourth moment of n normal numbers.
    for power, moment, variance in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)):
        assert abs(np.mean(values**power) - moment) < 5.0 * np.sqrt(variance / n)
    neighbours = np.corrcoef(values[:-1], values[1:])[0, 1]
    assert abs(neighbours) < 5.0 / np.sqrt(n)


def test_quantiles_meet_at_the_octaves() -> None:
    ends = quantile_table().sum(axis=1)
    starts = (quantile_table() * (-1.0) ** np.arange(quantile_table().shape[1])).sum(axis=1)
    # Both are within 3e-9 of the quantile between two octaves; the first octave ends at the median.
    np.testing.assert_allclose(ends[1:], starts[:-1], atol=6e-9)
    assert abs(ends[0]) < 6e-9


def test_faults(plant: Host) -> None:
    plant.initialize()
    plant.fmu.doStep(0.0, STEP)
    before = plant.get(STRAINS)
    plant.fmu.doStep(STEP, STEP)
    healthy = plant.get(STRAINS)
    for gauge, kind, value in (
        (1, GaugeFault.DROPOUT, 0.0),
        (2, GaugeFault.BIAS, 1e-3),
        (3, GaugeFault.DRIFT, 0.5),
        (4, GaugeFault.STUCK, 2e-3),
        (5, GaugeFault.FROZEN, 0.0),
    ):
        set_fault(plant, gauge, kind, value)
    at_onset = plant.get(STRAINS)
    assert np.isnan(at_onset[0])
    np.testing.assert_allclose(
        at_onset[1:], [healthy[1] + 1e-3, healthy[2], 2e-3, before[4], healthy[5]], rtol=1e-15
    )
    plant.fmu.doStep(2 * STEP, STEP)
    later = plant.get(STRAINS)
    noise = MODEL.noise_std * (gauge_noise(1, 3, N_GAUGES) - gauge_noise(1, 2, N_GAUGES))
    expected = [healthy[1] + noise[1] + 1e-3, healthy[2] + noise[2] + 0.5 * STEP, 2e-3, before[4]]
    np.testing.assert_allclose(later[1:5], expected, rtol=1e-12)
    for gauge in range(1, 6):
        set_fault(plant, gauge, GaugeFault.NONE)
    np.testing.assert_allclose(plant.get(STRAINS), healthy + noise, rtol=1e-12)


def test_motion_is_that_of_the_equations(flying: Host) -> None:
    moment = 2e4
    flying.set(["control_moment"], [moment])
    flying.initialize()
    speed = START.mach_number * speed_of_sound(START.altitude)

    def rates(_: float, state: np.ndarray) -> list[float]:
        angle, rate = state
        point = evaluate(
            MODEL,
            FlightCondition(
                mach_number=START.mach_number, angle_of_attack=angle, sideslip_angle=0.0, altitude=START.altitude
            ),
        )
        scale = point.dynamic_pressure * MODEL.reference_area
        damping = START.pitch_damping * rate * MODEL.reference_length / (2.0 * speed)
        pitching = scale * MODEL.reference_length * (point.coefficients[3] + damping) + moment
        return [rate - scale * point.coefficients[1] / (START.mass * speed), pitching / START.pitch_inertia]

    time = np.arange(101) * STEP
    solved = solve_ivp(
        rates, (0.0, 1.0), [START.angle_of_attack, 0.0], "DOP853", time, rtol=1e-12, atol=1e-14, max_step=1e-3
    )
    flown = [flying.get(["angle_of_attack", "pitch_rate"])]
    for start in time[:-1].tolist():
        flying.fmu.doStep(start, STEP)
        flown.append(flying.get(["angle_of_attack", "pitch_rate"]))
    assert np.ptp(np.array(flown)[:, 0]) > 1e-3
    # Runge-Kutta of fourth order at 1 ms over slow motion, within one cell: the random table jumps between cells.
    np.testing.assert_allclose(np.array(flown), solved.y.T, rtol=0.0, atol=1e-10)


def test_step_sizes_may_vary(fmus: dict[Motion, Path], tmp_path: Path) -> None:
    angles = []
    for steps in ([0.1], [0.05, 0.05], [0.03, 0.07]):
        with loaded(fmus[Motion.SHORT_PERIOD], tmp_path / str(steps)) as plant:
            plant.initialize()
            time = 0.0
            for step in steps:
                plant.fmu.doStep(time, step)
                time += step
            angles.append(plant.get(["angle_of_attack"])[0])
    np.testing.assert_allclose(angles, angles[0], rtol=1e-12)


def test_outside_the_envelope(plant: Host) -> None:
    plant.initialize()
    plant.set(["mach_number"], [9.0])
    assert np.all(np.isnan(plant.get([*COEFFICIENTS, *STRAINS])))
    with pytest.raises(Exception, match="discard"):
        plant.fmu.doStep(0.0, STEP)
    plant.set(["mach_number"], [float("nan")])
    assert np.all(np.isnan(plant.get(COEFFICIENTS)))
    plant.set(["mach_number"], [6.0])
    assert np.all(np.isfinite(plant.get([*COEFFICIENTS, *STRAINS])))


def test_parameters_are_checked_and_then_fixed(plant: Host) -> None:
    def seed(value: int) -> None:
        plant.fmu.setInteger([plant.references["seed"]], [value])

    for wrong in (-1, -(2**31)):
        with pytest.raises(Exception, match="error"):
            seed(wrong)
    for wrong_noise in (-1.0, float("nan"), float("inf")):
        with pytest.raises(Exception, match="error"):
            plant.set(["noise_std"], [wrong_noise])
    seed(7)
    plant.initialize()
    for fixed in (lambda: seed(8), lambda: plant.set(["noise_std"], [0.0])):
        with pytest.raises(Exception, match="error"):
            fixed()
    with pytest.raises(Exception, match="error"):
        set_fault(plant, 1, 6)  # type: ignore[arg-type]  # no such kind
    with pytest.raises(Exception, match="error"):
        plant.set(["C_A"], [0.0])
    assert plant.integers(["seed"]) == [7]


def test_states(flying: Host) -> None:
    flying.initialize()
    set_fault(flying, 2, GaugeFault.DRIFT, 1.0)
    set_fault(flying, 3, GaugeFault.FROZEN)
    for k in range(5):
        flying.fmu.doStep(k * STEP, STEP)
    fmu: FMU2Slave = flying.fmu
    outputs = [*COEFFICIENTS, *STRAINS, "pitch_rate", "angle_of_attack"]
    here, state = flying.get(outputs), fmu.getFMUState()
    serialized = fmu.serializeFMUState(state)
    fmu.doStep(5 * STEP, STEP)
    there = flying.get(outputs)
    assert np.any(there != here)
    fmu.setFMUState(state)
    np.testing.assert_array_equal(flying.get(outputs), here)
    fmu.freeFMUState(state)
    again = fmu.deSerializeFMUstate(serialized)
    fmu.setFMUState(again)
    fmu.doStep(5 * STEP, STEP)
    np.testing.assert_array_equal(flying.get(outputs), there)
    fmu.freeFMUState(again)
    damaged = bytearray(serialized)
    damaged[-3] ^= 1
    with pytest.raises(Exception, match="error"):
        fmu.deSerializeFMUstate(bytes(damaged))
    fmu.reset()
    flying.initialize()
    np.testing.assert_array_equal(flying.get(["angle_of_attack", "pitch_rate"]), [START.angle_of_attack, 0.0])


def test_states_of_another_plant(
    fmus: dict[Motion, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # The state of one motion is shorter than that of another: a write would leave its block.
    with (
        loaded(fmus[Motion.INPUTS], tmp_path / "one") as one,
        loaded(fmus[Motion.SHORT_PERIOD], tmp_path / "other") as other,
    ):
        one.initialize()
        other.initialize()
        for own, foreign in ((one.fmu, other.fmu), (other.fmu, one.fmu)):
            here, there, size = own.getFMUState(), foreign.getFMUState(), c_size_t(0)
            own_bytes, foreign_bytes = own.serializeFMUState(here), foreign.serializeFMUState(there)
            room = create_string_buffer(1 << 16)
            refused = {
                "fmi2GetFMUstate": (byref(there),),
                "fmi2SetFMUstate": (there,),
                "fmi2SerializedFMUstateSize": (there, byref(size)),
                "fmi2SerializeFMUstate": (there, room, len(room)),
                "fmi2DeSerializeFMUstate": (own_bytes, len(own_bytes), byref(there)),
            }
            capsys.readouterr()
            for name, arguments in refused.items():
                with pytest.raises(Exception, match="error"):
                    getattr(own, name)(own.component, *arguments)
                assert capsys.readouterr().out.count("the FMU state is that of another FMU") == 1
            with pytest.raises(Exception, match="error"):
                own.deSerializeFMUstate(foreign_bytes)
            assert capsys.readouterr().out.count("the serialised state is that of another FMU") == 1
            assert not any(room.raw)
            assert foreign.serializeFMUState(there) == foreign_bytes
            own.freeFMUState(here)
            foreign.freeFMUState(there)
