"""From a vehicle file to a proposed gauge layout, and to a review of one: ``strainfmu place`` and ``review``."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import Literal

import numpy as np

from builder.campaign.snapshots import Snapshots
from builder.figures.drawing import save
from builder.figures.placement_figures import placement_figure
from builder.inverse.problem import AnyStructure, inverse_problem
from builder.pipeline.load_test_proposal import flows_for_design
from builder.pipeline.map_files import cached_or_solved_structure, files_of_vehicle
from builder.pipeline.pipeline import MAP
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.pipeline.stages import fourier_structure, map_from, on_snapshots
from builder.placement import design
from builder.placement.candidates import CandidateGrid
from builder.placement.curves import Curves, accuracy_curves
from builder.placement.design import GOALS, Aim, Placement, Study, placement_study
from builder.placement.flight_models import Kind
from builder.placement.limits import Limits, Zone
from builder.placement.review import Review, review_of
from builder.reporting import Reporter, Silent
from builder.reports.build_report.build_findings import BuildReport, build_report
from builder.reports.build_report.build_page import report_page
from builder.reports.page.html import without_packages, write_page
from builder.reports.page.origin import InputFile, input_files
from builder.structure.as_built_kinds import ALWAYS_DRAWN, IN_NOISE
from builder.structure.fourier.fourier_model import refuse_beyond_fourier
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.gauges.gauge_entries import GaugeLayoutEntry
from builder.vehicle.gauges.layout import CSV_COLUMNS, GaugeLayout, read_layout
from builder.vehicle.map_needs import used_layouts
from strainfmu.errors import InputError
from strainfmu.estimator.map.inverse_map import load_inverse_map
from strainfmu.estimator.signal_names import COEFFICIENT_NAMES
from strainfmu.files import write_bytes_atomically


@dataclass(frozen=True, eq=False, kw_only=True)
class ProposedGauges:
    """A proposed layout with its study, and curves if requested."""

    study: Study
    placement: Placement
    curves: Curves | None


def place(
    vehicle: str | Path,
    gauges: int = 36,
    output: str | Path = "layout.csv",
    *,
    stations: Sequence[float] | None = None,
    roll_angles: Sequence[float] | None = None,
    directions: Sequence[str] = ("axial", "hoop"),
    spacing: float = 0.02,
    forbid: Sequence[Sequence[float]] = (),
    keep: str | Path | None = None,
    pairs: Literal["mirror", "opposite"] | None = None,
    budget: float | None = None,
    costs: Mapping[str, float] | None = None,
    cable: tuple[float, float] | None = None,
    kinds: int | None = None,
    goal: Literal["loads", "field", "air-data", "d-optimal"] = "loads",
    loads: Mapping[str, float] | None = None,
    estimator: Literal["linear", "nonlinear"] | None = None,
    starts: int = 20,
    robust: bool = False,
    losses: int = 1,
    curves: str | Path | None = None,
    snapshots: str | Path | None = None,
    progress: AnyProgress = None,
) -> ProposedGauges:
    """Place gauges so that the loads are as certain as possible, and write the layout.

    Candidates are all directions at a grid of stations and roll angles on the inner surface. The criterion is the
    estimator's own uncertainty over the flight states of the snapshots, installation errors included. Prints the
    sigmas with the layout in use and with the placed gauges, and how far any other choice could be below.

    On the command line::

        strainfmu place my_vehicle.toml --gauges 36 -o layout.csv --snapshots results/snapshots.h5
        strainfmu place my_vehicle.toml --gauges 24 --forbid 1.2:1.5 --forbid 0:4@80:100 --pairs mirror --robust

    Parameters
    ----------
    vehicle : vehicle file (TOML).
    gauges : number of gauges to place.
    output : layout file to write (CSV).
    stations : stations of the candidates [m]. Default: even ones.
    roll_angles : roll angles of the candidates [rad]. Default: even ones.
    directions : directions at each point: some of "axial", "hoop", "45", "-45", "rosette".
    spacing : smallest distance of gauges that are not at one point [m].
    forbid : zones without gauges: first and last station [m] and, if not all round, roll angle [rad].
    keep : layout file (CSV) of gauges that are placed in any case.
    pairs : place pairs: "mirror" (roll angles phi and -phi) or "opposite" (phi and phi + 180 deg).
    budget : largest cost of all gauges, instead of their number.
    costs : cost of a gauge by its direction, with ``budget``; 1 where none is stated.
    cable : cost of a metre of cable along the body, and the station that it runs to [m]; with ``budget``.
    kinds : number of directions that are used at most, the best ones. Default: all.
    goal : what to minimise: "loads", "field", "air-data" or "d-optimal".
    loads : weights of the loads by name; loads that are not named have 0.
    estimator : "linear" or "nonlinear". Default: as map.h5 next to the snapshots, else map.estimator.
    starts : starts of the exchanges.
    robust : keep every sigma within 1.3 times after the loss of any ``losses`` gauges.
    losses : gauges lost together that ``robust`` is about, 1 or 2.
    curves : figure of accuracy against the number of gauges (PNG).
    snapshots : flows in flight (snapshots.h5). Default: flows of a build, else local inclination.
    progress : True for progress bars.

    Raises
    ------
    InputError
        The vehicle file is wrong, the Fourier model cannot do what it requests, or no choice keeps the limits.
    """
    if goal not in GOALS:
        raise InputError(f"--goal: expected one of {', '.join(GOALS)}, got '{goal}'")
    for option, stated in (("--costs", bool(costs)), ("--cable", any(cable or ()))):
        if stated and budget is None:
            raise InputError(f"{option}: expected --budget with it, which limits the cost")
    if losses > 1 and not robust:
        raise InputError(f"--losses: {losses} needs --robust")
    grid = CandidateGrid(
        stations=None if stations is None else tuple(stations),
        roll_angles=None if roll_angles is None else _in_degrees(roll_angles),
        directions=tuple(directions),
        pairs=pairs or "",
    )
    limits = Limits(
        gauges=gauges if budget is None else None,
        budget=budget,
        costs=dict(costs or {}),
        spacing=spacing,
        zones=tuple(map(_zone, forbid)),
        kinds=kinds,
        cable=cable or (0.0, 0.0),
    )
    aim = Aim(goal=goal, weights=_weights(loads), estimator=estimator, starts=starts, robust=robust, losses=losses)
    proposed = propose_gauges(
        Path(vehicle),
        grid,
        limits,
        aim,
        reporter=reporter_of(progress),
        snapshots_path=None if snapshots is None else Path(snapshots),
        keep=None if keep is None else Path(keep),
        with_curves=curves is not None,
    )
    write_layout(proposed.placement.layout, Path(output))
    if curves is not None and proposed.curves is not None:
        save(placement_figure(proposed.curves, Path(vehicle).stem), Path(curves))
    return proposed


def _zone(bounds: Sequence[float]) -> Zone:
    start, end = _in_degrees(bounds[2:]) or (0.0, 360.0)
    return Zone(first=bounds[0], last=bounds[1], start=start, end=end)


def _in_degrees(angles: Sequence[float]) -> tuple[float, ...]:
    return tuple(round(degrees(angle), 9) for angle in angles)


def _weights(loads: Mapping[str, float] | None) -> tuple[float, ...]:
    """Return the weight of each coefficient."""
    if loads is None:
        return (1.0,) * len(COEFFICIENT_NAMES)
    for name, value in loads.items():
        if name not in COEFFICIENT_NAMES or value < 0.0:
            expected = f"expected weights from 0 of {', '.join(COEFFICIENT_NAMES)}"
            raise InputError(f"--loads: {expected}, got '{name}={value:g}'")
    if not any(loads.values()):
        raise InputError("--loads: expected one weight above 0, got none")
    return tuple(loads.get(name, 0.0) for name in COEFFICIENT_NAMES)


def propose_gauges(
    vehicle_path: Path,
    grid: CandidateGrid,
    limits: Limits,
    aim: Aim,
    *,
    reporter: Reporter,
    snapshots_path: Path | None = None,
    keep: Path | None = None,
    with_curves: bool = False,
) -> ProposedGauges:
    """Return gauges for the vehicle of a file; ``keep`` is a layout file of gauges that are placed in any case.

    Flows come from ``snapshots_path``, or else as :func:`flows_for_design` takes them.

    Raises
    ------
    InputError
        The vehicle file is wrong, the Fourier model cannot do what it requests, or no choice keeps the limits.
    """
    vehicle = load_vehicle(vehicle_path)
    check_model(vehicle)
    kept_layout = None if keep is None else read_layout(keep)
    for line in left_out(vehicle):
        reporter.note(line)
    snapshots = flows_for_design(vehicle, snapshots_path, reporter)
    structure = structure_of(vehicle, snapshots, reporter)
    kind, map_path = estimator_of_map(vehicle, aim.estimator, snapshots_path)
    with reporter.stage("Candidates: strain and models") as progress:
        study = placement_study(vehicle, snapshots, structure, grid, kind, keep=kept_layout, progress=progress)
    reporter.note(
        f"{study.offered} candidates, {study.model.rows.shape[-1]} unknowns, "
        f"{len(study.model.weight)} flight states, {judged(vehicle, study, snapshots, map_path)}"
    )
    placement = design.place(study, limits, aim, reporter)
    curves = None
    if with_curves:
        with reporter.stage("Curves") as progress:
            curves = accuracy_curves(study, limits, aim, placement.sites, progress)
    return ProposedGauges(study=study, placement=placement, curves=curves)


def estimator_of_map(
    vehicle: Vehicle, kind: Kind | None, snapshots_path: Path | None
) -> tuple[Kind | None, Path | None]:
    """Return the estimator that is used with the vehicle, and the map that it follows from.

    ``kind`` is the one of ``--estimator``. Without it the map of the vehicle next to the snapshots decides, as
    ``strainfmu build`` leaves it there. Without either both are None, and the vehicle file decides.
    """
    path = None if snapshots_path is None else snapshots_path.with_name(MAP)
    if kind is not None or path is None or not path.is_file():
        return kind, None
    inverse_map = load_inverse_map(path)
    if inverse_map.vehicle != vehicle.name:
        return None, None
    return "linear" if inverse_map.manifold is None else "nonlinear", path


def judged(vehicle: Vehicle, study: Study, snapshots: Snapshots, map_path: Path | None) -> str:
    """Return in a sentence which estimator is judged, why, and on which flows."""
    of_map = "" if map_path is None else f" (of {map_path.name})"
    if map_path is None and vehicle.map.estimator == "auto":
        of_map = " (build compares both for map.estimator 'auto'; --snapshots of its folder follows its map)"
    return f"{study.kind} estimator{of_map}, flows by the {snapshots.engine} engine"


def check_model(vehicle: Vehicle) -> None:
    """Refuse a structure that cannot be asked for strain at any point of the wall.

    Raises
    ------
    InputError
        Names the entry.
    """
    entry = vehicle.structure
    if entry.external is not None:
        raise InputError(
            f"structure.{entry.external}: place and review need strain at points without gauges, which the file "
            "of another code does not hold; state the wall or structure.mesh instead"
        )
    if vehicle.has_meridian:
        refuse_beyond_fourier(vehicle, [vehicle.gauges.layout])


def structure_of(vehicle: Vehicle, snapshots: Snapshots, reporter: Reporter) -> AnyStructure:
    """Return strain per pressure of the layouts that the map needs, at the nodes of ``snapshots``."""
    if vehicle.has_meridian:
        return fourier_structure(vehicle, used_layouts(vehicle), reporter)
    return on_snapshots(cached_or_solved_structure(vehicle, reporter), snapshots, reporter)


def left_out(vehicle: Vehicle) -> list[str]:
    """Return a line for every entry of the vehicle file that a placement does not count."""
    noise, lines = vehicle.noise, []
    if noise.nuisance_file is not None:
        lines.append("noise.nuisance_file: not counted, it holds the gauges of the layout in use alone")
    if noise.covariance_file is not None or noise.std_of_gauges_um_per_m is not None:
        lines.append("noise: every candidate has the median noise of the gauges in use")
    entries = dict.fromkeys(kind.entry for kind in IN_NOISE if kind.name not in ALWAYS_DRAWN)
    lines += [f"noise.{entry}: not counted" for entry in entries if getattr(noise, entry) > 0.0]
    if vehicle.temperature is not None and not vehicle.has_meridian:
        lines.append("temperature: modes of the wall's temperature are not counted but on a body of revolution")
    if vehicle.mass is not None:
        lines.append("mass: inertia and vibration are not counted")
    lines.append(
        "mesh: the error of strain by the structure's mesh is not counted; the report of a map built with the "
        "layout states it"
    )
    if vehicle.sensors is not None and vehicle.sensors.of_structure:
        names = ", ".join(f"sensors.{name}" for name in vehicle.sensors.of_structure)
        lines.append(f"{names}: not counted; with them fewer gauges do")
    return lines


def write_layout(layout: GaugeLayout, path: Path) -> None:
    """Write ``layout`` as the CSV file that an entry ``file`` of [gauges.layouts] takes."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for name, position, direction in zip(layout.names, layout.position, layout.direction, strict=True):
        values = np.concatenate([position, direction]) + 0.0
        writer.writerow([name, *(f"{0.0 if abs(value) < 1e-12 else value:.9g}" for value in values)])
    write_bytes_atomically(path, stream.getvalue().encode())


def review(
    vehicle: str | Path,
    layout: str | Path | None = None,
    output: str | Path = "review.html",
    *,
    estimator: Literal["linear", "nonlinear"] | None = None,
    snapshots: str | Path | None = None,
    progress: AnyProgress = None,
) -> Review:
    """Review a gauge layout: the report of a build with it, and how it compares with other layouts.

    The report judges a map of the layout. One section more names the gauges that could go, the one gauge that
    would help most, and the pressure that the gauges do not observe.

    On the command line::

        strainfmu review my_vehicle.toml --layout layout.csv -o review.html --snapshots results/snapshots.h5

    Parameters
    ----------
    vehicle : vehicle file (TOML).
    layout : a layout of the vehicle file, or a layout file (CSV). Default: the layout in use.
    output : page to write, with a PDF next to it.
    estimator, snapshots, progress : as :func:`place` takes them.

    Raises
    ------
    InputError
        As :func:`place` and :func:`build`; or there is no such layout.
    """
    return review_layout(
        Path(vehicle),
        None if layout is None else str(layout),
        Path(output),
        grid=CandidateGrid(),
        kind=estimator,
        reporter=reporter_of(progress),
        snapshots_path=None if snapshots is None else Path(snapshots),
    )


def review_layout(
    vehicle_path: Path,
    layout: str | None,
    path: Path,
    *,
    grid: CandidateGrid,
    kind: Kind | None,
    reporter: Reporter,
    snapshots_path: Path | None = None,
) -> Review:
    """Write the report of a layout with its review as a page, and as PDF next to it where reportlab is installed.

    ``layout`` is a name of the vehicle file or a layout file (CSV).

    Raises
    ------
    InputError
        As :func:`propose_gauges`; there is no such layout, or it cannot carry a map.
    """
    if path.suffix.lower() == ".pdf":
        raise InputError(
            f"--output: expected a page such as review.html, next to which the PDF is written, got '{path}'"
        )
    vehicle = with_layout(load_vehicle(vehicle_path), layout)
    check_model(vehicle)
    for line in left_out(vehicle):
        reporter.note(line)
    kind, map_path = estimator_of_map(vehicle, kind, snapshots_path)
    inputs = {"snapshots": snapshots_path, "map": map_path}
    files = input_files(
        files_of_vehicle(vehicle, vehicle_path) | {name: path for name, path in inputs.items() if path is not None}
    )
    snapshots = flows_for_design(vehicle, snapshots_path, reporter)
    structure = structure_of(vehicle, snapshots, reporter)
    with reporter.stage("Review: strain and models") as progress:
        study = placement_study(vehicle, snapshots, structure, grid, kind, progress=progress)
        review = review_of(study)
    reporter.note(judged(vehicle, study, snapshots, map_path))
    with reporter.stage("Review: the map of the layout"):
        report = report_of_layout(vehicle, snapshots, structure, study.kind, files)
    if report.in_use.is_nonlinear != (study.kind == "nonlinear"):
        reporter.note(
            f"report: of {report.in_use.name}: {report.inverse_map.provenance['estimator_choice']['why']}"
        )
    page = report_page(report, review)
    write_page(page, path)
    line = without_packages(path.name)
    if line:
        reporter.note(line)
        return review
    from builder.reports.page.pdf import write_pdf

    write_pdf(page, path.with_suffix(".pdf"))
    return review


def report_of_layout(
    vehicle: Vehicle, snapshots: Snapshots, structure: AnyStructure, kind: Kind, files: tuple[InputFile, ...]
) -> BuildReport:
    """Return the report of the map of the layout in use: nonlinear if that is the ``kind`` and gauges suffice."""
    entry = vehicle.map.model_copy(update={"estimator": "linear" if kind == "linear" else "auto"})
    chosen = vehicle.model_copy(update={"map": entry})
    problem = inverse_problem(chosen, snapshots, structure)
    inverse_map = map_from(chosen, snapshots, structure, Silent(), problem=problem, compares=False)
    return build_report(chosen, snapshots, structure, inverse_map, files=files, problem=problem)


def with_layout(vehicle: Vehicle, layout: str | None) -> Vehicle:
    """Return the vehicle with ``layout`` in use: a name of its file, or a layout file (CSV); None leaves its own.

    Raises
    ------
    InputError
        There is neither.
    """
    if layout is None:
        return vehicle
    gauges = vehicle.gauges
    if layout in gauges.layouts:
        return vehicle.model_copy(update={"gauges": gauges.model_copy(update={"layout": layout})})
    if not Path(layout).is_file():
        raise InputError(f"--layout: expected one of {', '.join(gauges.layouts)} or a CSV file, got '{layout}'")
    layouts = {**gauges.layouts, layout: GaugeLayoutEntry(file=str(Path(layout).resolve()))}
    return vehicle.model_copy(update={"gauges": gauges.model_copy(update={"layout": layout, "layouts": layouts})})
