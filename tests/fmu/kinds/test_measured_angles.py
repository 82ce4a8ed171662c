"""Measured angles in FMUs, whose hosts fill in 0 for inputs that nothing is connected to."""

from collections.abc import Callable, Iterator
from pathlib import Path

import fmpy
import numpy as np
import pytest
from flight_fmu import N_D, random_flight, whole_map
from fmu_experiment import Experiment
from fmu_host import OPTIONS

from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.estimator.air_inputs import ANGLE_ERROR, MEASURED_ANGLES
from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator

KINDS = {**OPTIONS, "native_3": ExportOptions(inputs="full", fmi_version="3", scalars=True)}
STRAINS = [f"strain[{i + 1}]" for i in range(N_D)]
COEFFICIENTS = ["C_A", "C_N", "C_Y", "M_P", "M_Y"]
SAMPLE = random_flight(whole_map(), 1, seed=5)[0]
ANGLE, SIDESLIP = MEASURED_ANGLES


@pytest.fixture(scope="module", params=KINDS)
def run(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[..., Experiment]]:
    """A function that takes a step of an FMU of a nonlinear map, with further inputs by name."""
    folder = tmp_path_factory.mktemp("angles")
    save_inverse_map(whole_map(), folder / "map.h5")
    export_estimator(folder / "map.h5", folder / "flight.fmu", KINDS[request.param])
    made: list[Experiment] = []

    def stepped(**inputs: float) -> Experiment:
        made.append(Experiment(folder / "flight.fmu", folder / f"unzipped_{len(made)}"))
        made[-1].set({**dict(zip(STRAINS, SAMPLE.strain, strict=True)), **SAMPLE.flow, **inputs})
        for k in range(3):
            assert made[-1].step(0.1 * k, 0.1) == 0
        return made[-1]

    yield stepped
    for one in made:
        one.end()


def coefficients(experiment: Experiment) -> list[float]:
    return experiment.get(COEFFICIENTS)


def test_an_angle_counts_with_a_standard_deviation_alone(run: Callable[..., Experiment]) -> None:
    without = coefficients(run())
    for std, angle in ((0.0, 0.0), (0.0, 0.05), (-1.0, 0.05), (np.nan, 0.05)):
        stds = {f"{ANGLE}_std": std, f"{SIDESLIP}_std": std}
        assert coefficients(run(**{ANGLE: angle, SIDESLIP: angle, **stds})) == without
    measured = coefficients(run(**{ANGLE: 0.0, f"{ANGLE}_std": ANGLE_ERROR, SIDESLIP: 0.0}))
    assert measured != without
    estimator = Estimator(whole_map())
    for _ in range(3):
        expected = estimator.track(SAMPLE.strain, **SAMPLE.flow, **{ANGLE: 0.0})  # which takes 1 deg
    assert measured == expected.coefficients.tolist()


def test_an_angle_that_does_not_count_is_logged_once(run: Callable[..., Experiment]) -> None:
    text = f"{SIDESLIP} = 0.05 rad does not count: {SIDESLIP}_std must be above 0"
    lone = run(**{ANGLE: 0.0, SIDESLIP: 0.05})
    assert [one for one in lone.messages if "does not count" in one] == [text]
    for inputs in ({}, {ANGLE: 0.0}, {ANGLE: np.nan}, {SIDESLIP: 0.05, f"{SIDESLIP}_std": 0.02}):
        assert not [one for one in run(**inputs).messages if "does not count" in one]


def test_descriptions_say_so(run: Callable[..., Experiment]) -> None:
    texts = run().descriptions
    for name in MEASURED_ANGLES:
        assert texts[name].endswith("; counts where its _std is above 0")
        assert texts[f"{name}_std"].endswith("; 0 or below (or NaN) leaves the angle out")


@pytest.mark.parametrize("kind", ["native", "python"])
def test_on_the_bus_and_in_recordings_an_fmu_takes_1_deg(tmp_path: Path, kind: str) -> None:
    save_inverse_map(whole_map(), tmp_path / "map.h5")
    export_estimator(tmp_path / "map.h5", tmp_path / "flight.fmu", OPTIONS[kind])
    inputs = SAMPLE.flow | {ANGLE: 0.02, f"{ANGLE}_std": np.nan}
    pressure = inputs.pop("dynamic_pressure")
    with FmuStep(tmp_path / "flight.fmu", tuple(inputs)) as step:
        found = step(SAMPLE.strain, pressure, 0.1, **inputs)
    expected = Estimator(whole_map()).track(SAMPLE.strain, **SAMPLE.flow, **{ANGLE: 0.02})
    assert found.coefficients.tolist() == expected.coefficients.tolist()


def test_fmpy_fills_in_0(tmp_path: Path) -> None:
    """A host that sets every input to 0 that its table does not hold gets the loads without measured angles."""
    save_inverse_map(whole_map(), tmp_path / "map.h5")
    export_estimator(tmp_path / "map.h5", tmp_path / "flight.fmu", OPTIONS["native"])
    inputs = {**dict(zip(STRAINS, SAMPLE.strain, strict=True)), **SAMPLE.flow}
    found = [
        fmpy.simulate_fmu(
            str(tmp_path / "flight.fmu"), stop_time=0.1, output_interval=0.1, start_values={**inputs, **zeros}
        )[COEFFICIENTS].tolist()
        for zeros in ({}, dict.fromkeys([*MEASURED_ANGLES, *(f"{one}_std" for one in MEASURED_ANGLES)], 0.0))
    ]
    assert found[0] == found[1]
