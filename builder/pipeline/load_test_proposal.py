"""From a vehicle file to a proposed ground test: ``strainfmu loadtest``."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from builder.calibration.ground_test.candidate_cases import Candidate, LoadLimits
from builder.calibration.ground_test.load_test import LoadErrors
from builder.calibration.ground_test.load_test_writer import WrittenCase, write_load_test
from builder.calibration.ground_test.simulated import error_entries
from builder.calibration.plan.load_plan import LoadPlan, PlanParts, load_plan
from builder.campaign.snapshot_fit import vehicle_misfits
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.pipeline.stages import fourier_structure, take_snapshots
from builder.reporting import Reporter
from builder.structure.as_built.structure import as_built_structure
from builder.structure.fourier.model import refuse_beyond_fourier
from builder.structure.loads.applied import Load, PadPressure, PointForce, SectionLoad, SurfacePressure, Weight
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.map_needs import used_layouts
from builder.workspace import refuse_misfits
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

HEAD = (
    "Proposed by strainfmu loadtest. To be filled in after the test: the recording, its channels.toml, and when",
    "each case was recorded (window_s, or row). Loads as they were measured replace those stated here.",
)


TEMPLATE_HEAD = (
    "Template of a ground test, written by strainfmu loadtest --template. It has a case of each usual kind: keep,",
    "copy and change what your test has, delete the rest. Fill in the recording, its channels.toml (written by",
    "strainfmu channels), when each case was recorded (window_s, or row), and every load as it was measured.",
    "Axes: x aft, y starboard, z up. All entries and kinds of load: docs/reference/load_test_file.md",
)


def propose_load_test(
    vehicle_path: Path,
    count: int,
    limits: LoadLimits,
    errors: LoadErrors,
    reporter: Reporter,
    snapshots_path: Path | None = None,
) -> LoadPlan:
    """Return load cases for the vehicle of a file.

    Flows come from ``snapshots_path``, or else from local inclination: which loads a test needs depends on where
    the flow presses, not on its last percent.

    Raises
    ------
    InputError
        The vehicle file is wrong, the Fourier model cannot do what it requests, or nothing may act.
    """
    vehicle = load_vehicle(vehicle_path)
    refuse_beyond_fourier(vehicle, [vehicle.gauges.layout])
    if vehicle.material.density_kg_per_m3 is None:
        reporter.note(
            f"{vehicle_path}: material.density_kg_per_m3 is missing: no cases of own weight, "
            "one without load instead"
        )
    snapshots = flows_for_design(vehicle, snapshots_path, reporter)
    structure = fourier_structure(vehicle, used_layouts(vehicle), reporter)
    with reporter.stage("Structure: as it may be built") as progress:
        as_built = as_built_structure(vehicle, vehicle.gauges.layout, progress=progress)
    parts = PlanParts(vehicle=vehicle, snapshots=snapshots, structure=structure, as_built=as_built)
    with reporter.stage("Load cases: the best next one") as progress:
        return load_plan(parts, count, limits, errors, progress=progress)


def write_proposal(plan: LoadPlan, vehicle_path: Path, path: Path, errors: LoadErrors) -> None:
    """Write ``loadtest.toml`` with the cases of ``plan``, windows to be filled in."""
    gained = [(case, remark(plan, number)) for number, case in enumerate(plan.cases)]
    first = plan.attitudes or (Candidate(name="no load", loads=()),)
    cases = [WrittenCase(name=case.name, loads=case.loads, remark=text) for case, text in gained]
    cases = [WrittenCase(name=case.name, loads=case.loads) for case in first] + cases
    write_load_test(
        path,
        f"{load_vehicle(vehicle_path).name}: ground test",
        cases,
        readings={"recording": None, "channels": None},
        errors=error_entries(errors),
        head=HEAD,
        vehicle=Path(os.path.relpath(vehicle_path, path.parent)).as_posix(),
    )


def write_template(vehicle_path: Path, path: Path, errors: LoadErrors) -> None:
    """Write ``loadtest.toml`` with an example of each usual load, to be changed to a test of the user's own.

    Raises
    ------
    InputError
        The vehicle file is wrong.
    """
    vehicle = load_vehicle(vehicle_path)
    length = round(vehicle.body().length, 4)
    weight = () if vehicle.material.density_kg_per_m3 is None else (Weight(),)
    without = "" if weight else "; own weight needs material.density_kg_per_m3 in the vehicle file"
    side = (Weight(up_roll_angle=0.5 * np.pi),) if weight else ()
    half = 0.5 * length
    pad = PadPressure(station=half, roll_angle=0.0, half_length=0.05, half_angle=np.pi / 6.0, push=1000.0)
    moment = SectionLoad(station=length, force=(0.0, 0.0, 500.0), moment=(0.0, 100.0, 0.0))
    rows: list[tuple[str, tuple[Load, ...], str]] = [
        ("level", weight, f"what acts in every case stands in every case, own weight first{without}"),
        ("on its side", side, "the meridian at roll angle 90 deg points up"),
        ("push on a pad", (*weight, pad), "a soft pad; push_N is the reading of the load cell behind it"),
        ("force on a point", (*weight, PointForce(station=half, roll_angle=0.0, force=(0.0, 0.0, -500.0))), ""),
        ("force and moment on a ring", (*weight, moment), "as an end fitting applies them"),
        ("internal pressure", (*weight, SurfacePressure(surface="inner", pressure=5e4)), "above the ambient one"),
    ]
    write_load_test(
        path,
        f"{vehicle.name}: ground test",
        [WrittenCase(name=name, loads=loads, remark=text) for name, loads, text in rows],
        readings={"recording": None, "channels": None, "reading_std_um_per_m": None},
        errors=error_entries(errors),
        head=TEMPLATE_HEAD,
        vehicle=Path(os.path.relpath(vehicle_path, path.parent)).as_posix(),
    )


def remark(plan: LoadPlan, number: int) -> str:
    """Return the sigmas over the sigmas of a vehicle known exactly once case ``number`` has been applied."""
    ratio = plan.sigmas[number] / plan.exact
    return "sigma over exact: " + ", ".join(f"{n} {r:.2f}" for n, r in zip(COEFFICIENT_NAMES, ratio, strict=True))


def flows_for_design(vehicle: Vehicle, path: Path | None, reporter: Reporter) -> Snapshots:
    """Return the flows of a file, else of local inclination where the vehicle's own take long.

    Raises
    ------
    InputError
        The file is of another body.
    """
    if path is not None:
        snapshots = load_snapshots(path)
        refuse_misfits(path, vehicle_misfits(snapshots, vehicle))
        return snapshots
    if vehicle.aerodynamics.engine == "euler":
        reporter.note("flows: local inclination; --snapshots reads flows from a file")
        aerodynamics = vehicle.aerodynamics.model_copy(update={"engine": "newtonian"})
        vehicle = vehicle.model_copy(update={"aerodynamics": aerodynamics})
    return take_snapshots(vehicle, progress=reporter)


def sigma_rows(plan: LoadPlan) -> list[tuple[str, list[float]]]:
    """Return what is printed: name of each step and the sigmas over the sigmas of a vehicle known exactly [1]."""
    first = "own weight, " + str(len(plan.attitudes)) + " attitudes" if plan.attitudes else "no load: zeros"
    rows = [("by the drawing", plan.before), (first, plan.after_attitudes)]
    rows += [(case.name, sigma) for case, sigma in zip(plan.cases, plan.sigmas, strict=True)]
    return [(name, [float(one) for one in np.asarray(sigma) / plan.exact]) for name, sigma in rows]
