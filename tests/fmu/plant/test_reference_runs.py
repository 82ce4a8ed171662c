"""Reference runs of plant, autopilot and schedule: what importers must repeat, and the folders that hold it."""

import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from slender_vehicle import make_slender_files, slender_flight_model
from sweeps import sweep
from synthetic_vehicle import SyntheticFiles

from strainfmu.cli.main import main
from strainfmu.cosim.models import flight_model
from strainfmu.cosim.models.autopilot import AutopilotSettings
from strainfmu.cosim.models.autopilot_law import AutopilotSample, AutopilotState, autopilot_design, next_state
from strainfmu.cosim.models.flight_model import load_flight_model
from strainfmu.cosim.models.plant_law import Plant
from strainfmu.cosim.models.schedule import ScheduledSignal
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.errors import InputError
from strainfmu.files import built_time_of
from strainfmu.fmu.checks.crosscheck import crosscheck
from strainfmu.fmu.checks.importers import read_table
from strainfmu.fmu.plant_export import export_autopilot, export_native_plant, export_schedule
from strainfmu.fmu.reference_run.plant import covering_step, plant_reference
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.plant_variables import FlightStart, GaugeFault, Motion

START = FlightStart(mach_number=6.0, altitude=20e3, angle_of_attack=0.05)
NATIVE = ("inputs", "trajectory", "short_period", "autopilot", "schedule")
KINDS = (*NATIVE, *(f"{kind}_3" for kind in NATIVE), "python")
"""Kinds of FMI 3.0 end on 3."""

SIGNALS = [
    ScheduledSignal(
        Variable(name="angle", description="one", causality="output", unit="rad"),
        (0.0, 1.0, 7.5),
        (0.1, 0.2, -0.3),
    ),
    ScheduledSignal(
        Variable(name="kind", description="two", causality="output", variability="discrete", fmi_type="Integer"),
        (0.0, 4.0),
        (0.0, 5.0),
    ),
    ScheduledSignal(
        Variable(name="used", description="three", causality="output", variability="discrete", fmi_type="Boolean"),
        (2.0, 3.0),
        (1.0, 0.0),
    ),
]


@pytest.fixture(scope="module")
def references(synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One FMU of every kind round the estimator."""
    folder = tmp_path_factory.mktemp("references")
    make_slender_files(folder)
    vehicle = folder / "flight_model.h5"
    fmus = {name: folder / f"{name}.fmu" for name in KINDS}
    for end, version in (("", "2"), ("_3", "3")):
        for motion in (Motion.INPUTS, Motion.SHORT_PERIOD):
            export_native_plant(
                flight_model_path=vehicle,
                fmu_path=fmus[f"{motion.name.lower()}{end}"],
                motion=motion,
                start=START,
                trajectory_path=None,
                platforms=None,
                seed=7,
                fmi_version=version,
            )
        export_native_plant(
            flight_model_path=synthetic.flight_model,
            fmu_path=fmus[f"trajectory{end}"],
            motion=Motion.TRAJECTORY,
            start=START,
            trajectory_path=synthetic.trajectory,
            fmi_version=version,
        )
        export_autopilot(vehicle, fmus[f"autopilot{end}"], START, fmi_version=version)
        export_schedule(SIGNALS, fmus[f"schedule{end}"], fmi_version=version)
    fmus["python"] = synthetic.plant
    return fmus


def test_the_command_writes_a_plant_of_fmi_3(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["plant", str(synthetic.flight_model), "--fmi", "3", "-o", str(tmp_path / "plant.fmu")])
    found = read_model_description(str(tmp_path / "plant.fmu"))
    built = built_time_of(synthetic.flight_model, flight_model.SCHEMA, flight_model.SCHEMA_VERSION)
    assert (found.fmiVersion, found.generationDateAndTime) == ("3.0", built)


@pytest.mark.parametrize(
    "kind", sweep(KINDS, ["inputs", "trajectory_3", "short_period_3", "autopilot", "schedule_3", "python"])
)
def test_importers_repeat_the_run(references: dict[str, Path], tmp_path: Path, kind: str) -> None:
    """Each FMU gives what numpy gave, to the 6 digits of the file; the folder is that of the rules."""
    results = crosscheck(references[kind], tmp_path)
    model = next(path.stem for path in tmp_path.glob("*.fmu"))
    expected = {f"{model}{end}" for end in (".fmu", "_in.csv", "_ref.csv", "_ref.opt")}
    assert {path.name for path in tmp_path.iterdir()} == {*expected, "Readme.txt"}
    outcomes = {result.importer.split()[0]: result for result in results}
    assert outcomes["FMPy"].outcome == "passed", outcomes["FMPy"].line
    assert all(result.outcome != "failed" for result in results), [result.line for result in results]
    readme = (tmp_path / "Readme.txt").read_text()
    with zipfile.ZipFile(references[kind]) as archive:
        source = json.loads(archive.read("extra/strainfmu/contents.json"))["reference"]
        page = archive.read("documentation/index.html").decode()
    assert source in readme
    assert source in page
    assert validate_fmu(str(references[kind])) == []


def test_runs_show_what_the_models_do(references: dict[str, Path]) -> None:
    """Faults of each kind, a gauge taken out of use, an estimate that is not trusted, jumps: none is left out."""
    tables = {}
    for kind, path in references.items():
        with zipfile.ZipFile(path) as archive:
            content = archive.read("extra/org.fmi-standard.fmi-ls-ref/reference_out.csv")
        copy = path.with_suffix(".csv")
        copy.write_bytes(content)
        tables[kind] = {name: np.array(cells)[:, 0] for name, cells in read_table(copy).items()}
    for kind in ("inputs", "trajectory", "short_period"):
        failing = slice(6, 16)  # inputs of rows 5 to 14
        assert len(tables[kind]["time"]) == 21
        assert set(tables[kind]["strain[3]"][failing]) == {2e-4}
        assert len(set(tables[kind]["strain[4]"][failing])) == 1
        assert np.ptp(tables[kind]["strain[5]"]) > 0.0
    assert np.ptp(tables["short_period"]["pitch_rate"]) > 1e-3
    autopilot = tables["autopilot"]
    assert {*autopilot["trusted"]} == {0.0, 1.0}
    assert autopilot["isolated_gauges"][-1] == 1.0
    assert autopilot["valid[1]"][-1] == 0.0
    # The bound hides the law where it acts: at most half of the rows may lie on it.
    assert np.mean(np.abs(autopilot["control_moment"]) > 1999.0) < 0.5
    assert [*tables["schedule"]["used"][[0, -1]]] == [1.0, 0.0]
    assert tables["schedule"]["angle"][-1] == -0.3


def test_a_run_ends_with_the_envelope() -> None:
    """A vehicle that pitches up beyond 12 deg gives a shorter run, one that starts outside none."""
    model = slender_flight_model()
    unstable = replace(model, coefficient_table=model.coefficient_table * np.array([1.0, 1.0, -1.0]))
    for vehicle, degrees, rows in ((model, 3.0, 21), (unstable, 11.7, 11)):
        start = replace(START, angle_of_attack=np.radians(degrees), mass=1e6)
        run = plant_reference(Plant(model=vehicle, motion=Motion.SHORT_PERIOD, start=start)).run
        assert run is not None
        assert len(run.time) == len(run.inputs["control_moment"]) == len(run.outputs["C_N"]) == rows
        incidence = np.hypot(run.outputs["angle_of_attack"], run.inputs["sideslip_angle"])
        assert incidence.max() < np.radians(12.0)
    assert (
        plant_reference(Plant(model=model, motion=Motion.SHORT_PERIOD, start=replace(START, mach_number=9.0))).run
        is None
    )


def test_an_fmu_without_a_run_says_so(tmp_path: Path) -> None:
    make_slender_files(tmp_path)
    path = tmp_path / "outside.fmu"
    # Nearly without inertia it turns out of the envelope within the first step.
    export_native_plant(
        flight_model_path=tmp_path / "flight_model.h5",
        fmu_path=path,
        motion=Motion.SHORT_PERIOD,
        start=replace(START, pitch_inertia=1e-3),
    )
    with pytest.raises(InputError, match="holds no reference run"):
        crosscheck(path, tmp_path / "none")


def test_the_law_places_its_poles() -> None:
    """With the truth as estimate, a'' = w^2 (a_c - a) - 2 z w a' follows from the moment, whatever the vehicle."""
    model, settings = slender_flight_model(), AutopilotSettings(largest_moment=1e9)
    design = autopilot_design(model, START)
    scale = 1.4e5 * design.reference_area
    angle, rate, command = 0.05, 0.03, 0.08
    # C_N = 3 a of the slender vehicle; M_P = -0.2 a.
    sample = AutopilotSample(
        commanded_angle_of_attack=command,
        C_N=3.0 * angle,
        M_P=-0.2 * angle,
        chi_square=0.0,
        chi_square_limit=1.0,
        suspect_gauge=0,
        dynamic_pressure=1.4e5,
        pitch_rate=rate,
    )
    state = next_state(
        design=design,
        settings=settings,
        state=AutopilotState(valid=(True,) * model.n_gauges),
        sample=sample,
        time=0.0,
    )
    lift_rate = scale / (design.mass * design.speed) * 3.0
    angle_rate = rate - lift_rate * angle
    pitching = state.control_moment + scale * design.reference_length * -0.2 * angle
    acceleration = pitching / design.pitch_inertia - lift_rate * angle_rate
    w, z = settings.frequency, settings.damping_ratio
    assert state.angle == pytest.approx(angle, rel=1e-9)
    assert acceleration == pytest.approx(w**2 * (command - angle) - 2.0 * z * w * angle_rate, rel=1e-9)


@pytest.mark.parametrize(
    ("span", "n", "step"), [(20.0, 20, 1.0), (20.0, 42, 0.5), (0.4, 20, 0.02), (21.0, 20, 2.0), (7.5, 42, 0.2)]
)
def test_steps_are_round_and_cover(span: float, n: int, step: float) -> None:
    assert covering_step(span, n) == step
    assert n * covering_step(span, n) >= span


def test_frozen_is_among_the_faults(synthetic: SyntheticFiles) -> None:
    """The gauge goes on reading what it read one row before the onset."""
    model, trajectory = load_flight_model(synthetic.flight_model), load_trajectory(synthetic.trajectory)
    run = plant_reference(Plant(model=model, motion=Motion.TRAJECTORY, start=START, trajectory=trajectory)).run
    assert run is not None
    onset = int(np.argmax(run.inputs["fault_kind[4]"] == float(GaugeFault.FROZEN)))
    assert set(run.outputs["strain[4]"][onset + 1 : onset + 5]) == {run.outputs["strain[4]"][onset - 1]}
