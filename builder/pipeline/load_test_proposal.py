"""From a vehicle file to a proposed ground test: ``strainfmu loadtest``."""

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from builder.aero.shapes import outer_surface
from builder.calibration.ground_test.candidate_cases import LoadLimits
from builder.calibration.ground_test.load_test import LoadErrors
from builder.calibration.ground_test.load_test_file import WrittenCase, WrittenStep, error_entries, write_load_test
from builder.calibration.plan.load_plan import (
    LoadPlan,
    PlanParts,
    RunCase,
    Schedule,
    established,
    load_plan,
    run_order,
    undetermined,
    whole_time,
)
from builder.campaign.snapshot_fit import vehicle_misfits
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.figures.calibration import load_plan_figure
from builder.figures.drawing import save
from builder.pipeline.map_files import cached_snapshots
from builder.pipeline.pipeline import STRUCTURE
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.pipeline.stages import AnyStructure, fourier_structure, take_snapshots
from builder.reporting import Reporter
from builder.structure.as_built.as_built_structure import as_built_structure
from builder.structure.as_built.displaced_structure import AnyAsBuilt, displaced_structure, refuse_untestable
from builder.structure.loads.applied import Load, PadPressure, PointForce, SectionLoad, SurfacePressure, Weight
from builder.structure.mapped_structure import mapped_structure
from builder.structure.structure_file import load_structure
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.map_needs import used_layouts
from builder.workspace import refuse_misfits
from strainfmu.estimator.map.inverse_map import COEFFICIENT_NAMES

HEAD = (
    "Proposed by strainfmu loadtest. To be filled in after the test: the recording, its channels.toml, and when",
    "each case and step was recorded (window_s, or row). Loads as they were measured replace those stated here.",
    "Steps (case.step) show hysteresis and the return to zero; delete those that were not run. Check loads",
    "(check = true) are predicted and not fitted.",
)

KINDS = {
    "attitude": "",
    "zero reading": "zero reading: the vehicle as in the first case, nothing else acts",
    "check": "check load: predicted by calibrate, not fitted",
    "repeat": "repeated: take the rig off and set it up again; ",
    "load": "",
}
"""Comments of cases by their kind, followed by what a case is worth."""


AHEAD = 0.05
"""Station of the section load of the template over the length, ahead of the gauges and behind a solid tip."""

TEMPLATE_HEAD = (
    "Template of a ground test, written by strainfmu loadtest --template. It has a case of each usual kind: keep,",
    "copy and change what your test has, delete the rest. Fill in the recording, its channels.toml (written by",
    "strainfmu channels), when each case was recorded (window_s, or row), and every load as it was measured.",
    "Steps (case.step) on the way to a load and back show hysteresis and the return to zero.",
    "Axes: x aft, y starboard, z up. All entries and kinds of load: docs/reference/load_test_file.md",
)


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadTestProposal:
    """A proposed ground test: load cases, lines on what they leave undetermined and on their time, and files."""

    plan: LoadPlan
    lines: tuple[str, ...]
    files: tuple[Path, ...]


def loadtest(
    vehicle: str | Path,
    cases: int = 12,
    output: str | Path = "loadtest.toml",
    *,
    force: float = 1500.0,
    directions: Sequence[str] = ("in",),
    stations: Sequence[float] | None = None,
    roll_angles: Sequence[float] = tuple(map(radians, range(0, 360, 45))),
    attitudes: Sequence[float] = tuple(map(radians, range(0, 360, 90))),
    pad_length: float = 0.1,
    pad_angle: float = radians(60.0),
    pressure: float = 0.0,
    axial: float = 0.0,
    largest_strain: float = 1e-3,
    load_error: float = 0.005,
    cell_error: float = 0.005,
    load_cells: int = 1,
    noise: float | None = None,
    samples: int = 25,
    steps: int = 2,
    checks: int = 2,
    repeats: int = 1,
    setup_time: float = 900.0,
    reading_time: float = 60.0,
    snapshots: str | Path | None = None,
    structure: str | Path | None = None,
    progress: AnyProgress = None,
) -> LoadTestProposal:
    """Propose the load cases of a ground test, in the order in which they lower the uncertainty in flight.

    Prints the gain of each case, what the test leaves undetermined and the time it takes. Writes a file of the
    test, to be filled in after it, and a figure. Each load is applied in steps, and removed in steps down to
    zero; check loads, repeated cases and zero readings are part of the file.

    The semi-analytic model of a body of revolution varies wall, support, mass and gauges; own weight comes first,
    in each attitude, with material.density_kg_per_m3 in the vehicle file. Of sections, meshes and influence
    matrices gauges, modulus and forces on the outer surface are varied. Section ``calibration`` of the vehicle
    file states the tolerances.

    With ``template``, writes a file of examples instead, for a test that you have designed or done yourself.

    On the command line::

        strainfmu loadtest my_vehicle.toml --template -o loadtest.toml
        strainfmu loadtest my_vehicle.toml --cases 12 -o loadtest.toml
        strainfmu loadtest my_vehicle.toml --force 800 --stations 0.6,1.2,2.4 --directions in,around --pressure 100

    Parameters
    ----------
    vehicle : vehicle file (TOML).
    cases : load cases, in addition to own weight.
    output : file to write.
    force : largest force on a pad [N].
    directions : directions of a pad's force: some of "in", "out", "axial", "around".
    stations : stations of the pads [m]. Default: ten along the hollow part.
    roll_angles : roll angles of the pads [rad].
    attitudes : attitudes of the vehicle: roll angles of the meridian that points up [rad].
    pad_length : length of a pad [m].
    pad_angle : angle that a pad spans [rad].
    pressure : internal pressure [Pa]; 0: none.
    axial : axial force [N]; 0: none.
    largest_strain : largest strain of any gauge [m/m]; loads are lowered to it.
    load_error : error of each load, 1 sigma [1].
    cell_error : error of all loads together, 1 sigma [1].
    load_cells : load cells that the loads stand on in turn, each with ``cell_error``.
    noise : noise of one sample of the recorder, 1 sigma [m/m]. Default: the vehicle file's.
    samples : samples that a reading is the mean of.
    steps : steps of loading, and as many of unloading.
    checks : check loads, which the fit does not see.
    repeats : load cases that are applied again at the end.
    setup_time : time to set up a case or an attitude [s].
    reading_time : time to apply a load, wait until it stands and record it [s].
    snapshots : flows in flight (snapshots.h5). Default: local inclination.
    structure : structure.h5 of a vehicle whose structure is no semi-analytic one. Default: next to the snapshots.
    progress : True for progress bars.

    Raises
    ------
    InputError
        The vehicle file is wrong, the Fourier model cannot do what it requests, or nothing may act.
    """
    path, reporter, output = Path(vehicle), reporter_of(progress), Path(output)
    limits = LoadLimits(
        force=force,
        stations=None if stations is None else tuple(stations),
        roll_angles=tuple(roll_angles),
        directions=tuple(directions),
        half_length=0.5 * pad_length,
        half_angle=0.5 * pad_angle,
        internal_pressure=pressure,
        axial_force=axial,
        attitudes=tuple(attitudes),
        largest_strain=largest_strain,
    )
    schedule = Schedule(steps=steps, setup_time=setup_time, reading_time=reading_time)
    errors = LoadErrors(load=load_error, common=cell_error)
    counts = {"samples": samples, "checks": checks, "repeats": repeats}
    plan = _load_plan(
        path,
        cases,
        limits,
        replace(errors, common=cell_error / load_cells**0.5),  # they differ independently
        reporter,
        snapshots_path=snapshots,
        structure_path=structure,
        noise=noise,
        **counts,
    )
    write_proposal(plan, path, output, errors, schedule)
    picture = output.with_suffix(".png")
    save(load_plan_figure(plan, path.stem), picture)
    lines = (*left_lines(plan), *cell_lines(load_cells), time_line(plan, schedule))
    return LoadTestProposal(plan=plan, lines=lines, files=(output, picture))


def _load_plan(
    vehicle_path: Path,
    count: int,
    limits: LoadLimits,
    errors: LoadErrors,
    reporter: Reporter,
    snapshots_path: str | Path | None,
    structure_path: str | Path | None,
    **options: Any,
) -> LoadPlan:
    """Return load cases for the vehicle of a file; options as of :func:`load_plan`."""
    vehicle = load_vehicle(vehicle_path)
    refuse_untestable(vehicle)
    snapshots = flows_for_design(vehicle, snapshots_path, reporter)
    structure: AnyStructure
    with reporter.stage("Structure: as it may be built") as progress:
        if vehicle.structure.model == "solid":
            solid = Path(structure_path or Path(snapshots_path or vehicle_path).with_name(STRUCTURE))
            structure = mapped_structure(load_structure(solid), snapshots)
            as_built: AnyAsBuilt = displaced_structure(vehicle, structure)
        else:
            as_built = as_built_structure(vehicle, vehicle.gauges.layout, progress=progress)
            structure = fourier_structure(vehicle, used_layouts(vehicle), reporter)
    if as_built.weightless:
        reporter.note(f"{vehicle_path}: a case without load, none of own weight: {as_built.weightless}")
    parts = PlanParts(vehicle=vehicle, snapshots=snapshots, structure=structure, as_built=as_built)
    with reporter.stage("Load cases: the best next one") as progress:
        return load_plan(parts, count, limits, errors, progress=progress, **options)


def write_proposal(
    plan: LoadPlan, vehicle_path: Path, path: Path, errors: LoadErrors, schedule: Schedule | None = None
) -> None:
    """Write ``loadtest.toml`` with the cases of ``plan`` as they are run, windows to be filled in."""
    schedule = schedule or Schedule()
    cases = [_written(run, plan, schedule) for run in run_order(plan)]
    write_load_test(
        path,
        f"{load_vehicle(vehicle_path).name}: ground test",
        cases,
        readings={"recording": None, "channels": None},
        errors=error_entries(errors),
        head=(*HEAD, "", *left_lines(plan), time_line(plan, schedule)),
        vehicle=Path(os.path.relpath(vehicle_path, path.parent)).as_posix(),
        blanks=True,
    )


def _written(run: RunCase, plan: LoadPlan, schedule: Schedule) -> WrittenCase:
    """Return a case as it stands in the file."""
    worth = remark(plan, run.number) if run.number >= 0 else ""
    return WrittenCase(
        name=run.case.name,
        loads=run.case.loads,
        remark=f"{KINDS[run.kind]}{worth}",
        check=run.kind == "check",
        steps=tuple(
            WrittenStep(part=part, unloading=unloading) for part, unloading in schedule.steps_of(run.case)
        ),
    )


def left_lines(plan: LoadPlan) -> list[str]:
    """Return what the test will leave undetermined, for the noise that is stated: a line each."""
    noise, last = 1e6 * float(np.median(plan.noise_std)), plan.sigmas[-1]
    sigma = ", ".join(f"{n} {s:.2g}" for n, s in zip(COEFFICIENT_NAMES, last, strict=True))
    ratio = ", ".join(f"{n} {s:.2f}" for n, s in zip(COEFFICIENT_NAMES, last / plan.exact, strict=True))
    return [
        f"noise {noise:.2g} um/m of a sample, {plan.samples} samples a reading",
        f"sigma in flight after the test: {sigma}",
        f"in units of a vehicle known exactly: {ratio}",
        *(line for line in (established(plan.kinds), undetermined(plan.kinds)) if line),
        "the gain that all load cells have in common stays as stated",
    ]


def cell_lines(load_cells: int) -> list[str]:
    """Return what the file still needs where there is more than one load cell."""
    return (
        [] if load_cells == 1 else [f"{load_cells} load cells: name them in the file, and each load's load_cell"]
    )


def time_line(plan: LoadPlan, schedule: Schedule) -> str:
    """Return how long the test takes, in one line."""
    kinds = Counter(run.kind for run in run_order(plan))
    parts = [
        f"{kinds[kind]} {name}"
        for kind, name in (
            ("attitude", "attitudes" if plan.attitudes else "without load"),
            ("load", "load cases"),
            ("repeat", "repeated"),
            ("check", "check loads"),
            ("zero reading", "zero readings"),
        )
        if kinds[kind]
    ]
    readings = 1 + 2 * schedule.steps
    return (
        f"time: {whole_time(plan, schedule) / 3600.0:.1f} h for {', '.join(parts)}; {readings} readings of each "
        f"load, {schedule.setup_time / 60.0:g} min to set up, {schedule.reading_time / 60.0:g} min a reading"
    )


def loadtest_template(
    vehicle: str | Path,
    output: str | Path = "loadtest.toml",
    *,
    load_error: float = 0.005,
    cell_error: float = 0.005,
) -> None:
    """Write ``loadtest.toml`` with an example of each usual load, to be changed to a test of the user's own.

    Parameters
    ----------
    vehicle : vehicle file (TOML).
    output : file to write.
    load_error : error of each load, 1 sigma [1].
    cell_error : error of all loads together, 1 sigma [1].

    Raises
    ------
    InputError
        The vehicle file is wrong, or of a vehicle that cannot be calibrated.
    """
    write_template(Path(vehicle), Path(output), LoadErrors(load=load_error, common=cell_error))


def write_template(vehicle_path: Path, path: Path, errors: LoadErrors) -> None:
    """Write the file of :func:`loadtest_template`."""
    vehicle = load_vehicle(vehicle_path)
    refuse_untestable(vehicle)
    entry = vehicle.structure
    varies_wall = entry.model != "solid"
    length = round(float(outer_surface(vehicle, vehicle.resolution.map)[0].point[:, 0].max()), 4)
    weighs = varies_wall and entry.support != "free_flight" and vehicle.material.density_kg_per_m3 is not None
    weight = (Weight(),) if weighs else ()
    without = "" if weight else "; own weight needs material.density_kg_per_m3, a profile and a body that is held"
    side = (Weight(up_roll_angle=0.5 * np.pi),) if weight else ()
    half = 0.5 * length
    pad = PadPressure(station=half, roll_angle=0.0, half_length=0.05, half_angle=np.pi / 6.0, push=1000.0)
    ahead = round(max(entry.solid_tip_length_m or 0.0, AHEAD * length), 4)
    moment = SectionLoad(station=ahead, force=(0.0, 0.0, 500.0), moment=(0.0, 100.0, 0.0))
    inside = SurfacePressure(surface="inner", pressure=5e4)
    both = (
        PadPressure(
            station=0.4 * length, roll_angle=0.5 * np.pi, half_length=0.05, half_angle=np.pi / 6.0, push=800.0
        ),
    )
    rows: list[tuple[str, tuple[Load, ...], str]] = [
        ("level", weight, f"what acts in every case stands in every case, own weight first{without}"),
        ("on its side", side, "the meridian at roll angle 90 deg points up"),
        ("push on a pad", (*weight, pad), "a soft pad; push_N is the reading of the load cell behind it"),
        ("force on a point", (*weight, PointForce(station=half, roll_angle=0.0, force=(0.0, 0.0, -500.0))), ""),
        ("force and moment on a ring", (*weight, moment), "as a fitting applies them; gauges aft of it read it"),
        *([("internal pressure", (*weight, inside), "above the ambient one")] if varies_wall else []),
        ("check load", (*weight, pad, *both), "predicted and not fitted: loads that the other cases do not have"),
    ]
    stepped = tuple(
        WrittenStep(part=part, unloading=unloading)
        for part, unloading in ((0.0, False), (0.5, False), (0.5, True), (0.0, True))
    )
    write_load_test(
        path,
        f"{vehicle.name}: ground test",
        [
            WrittenCase(
                name=name,
                loads=loads,
                remark=text,
                check=name == "check load",
                steps=stepped if name == "push on a pad" else (),
            )
            for name, loads, text in rows
        ],
        readings={"recording": None, "channels": None, "reading_std_um_per_m": None},
        errors=error_entries(errors),
        head=TEMPLATE_HEAD,
        vehicle=Path(os.path.relpath(vehicle_path, path.parent)).as_posix(),
        blanks=True,
    )


def remark(plan: LoadPlan, number: int) -> str:
    """Return the sigmas over the sigmas of a vehicle known exactly once case ``number`` has been applied."""
    ratio = plan.sigmas[number] / plan.exact
    return "sigma over exact: " + ", ".join(f"{n} {r:.2f}" for n, r in zip(COEFFICIENT_NAMES, ratio, strict=True))


def flows_for_design(vehicle: Vehicle, path: str | Path | None, reporter: Reporter) -> Snapshots:
    """Return flows of a file, else what another command left, else local inclination where the vehicle's
    own take long.

    Raises
    ------
    InputError
        The file is of another body.
    """
    if path is not None:
        snapshots = load_snapshots(path)
        refuse_misfits(path, vehicle_misfits(snapshots, vehicle))
        return snapshots
    if (file := cached_snapshots(vehicle)) is not None:
        reporter.note(f"flows: snapshots from {file.parent}, reused")
        return load_snapshots(file)
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
    return [(name, [float(ratio) for ratio in np.asarray(sigma) / plan.exact]) for name, sigma in rows]
