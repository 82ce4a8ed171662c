"""The whole way, from a vehicle file to an FMU flying in a system simulation.

Every link writes a file into one folder; a link whose inputs have not changed is not computed again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from builder import figures
from builder import snapshots as snapshots_file
from builder.aero.engine import Flow, FlowKey
from builder.aero.engines import make_engine
from builder.build import AnyStructure, build_inverse_map, check_noise
from builder.campaign.journal import Journal
from builder.campaign.notes import campaign_notes
from builder.campaign.run import complete_flows, run_campaign
from builder.campaign.scheduling import Scheduling
from builder.campaign.vehicle_campaign import vehicle_campaign
from builder.flight_score import FlightScore, score_flight
from builder.flight_tables import flight_model, truth_engine, truth_keys, truth_knots
from builder.geometry import surface_grid
from builder.reporting import Reporter
from builder.reports import build_page
from builder.reports.build_report import BuildReport, build_report
from builder.snapshot_transfer import snapshots_on
from builder.snapshots import Snapshots, load_snapshots
from builder.structural_model import (
    check_gauges,
    check_map_size,
    refuse_beyond_fourier,
    solid_case,
    structural_model,
    used_layouts,
)
from builder.structure import structure_file
from builder.structure.mapped_structure import mapped_structure
from builder.structure.solid.model import update_structure
from builder.structure.solid.reference_loads import mesh_error_line
from builder.structure.structure_file import load_structure
from builder.vehicle import Vehicle, load_vehicle
from builder.workspace import Workspace
from strainfmu import inverse_map as inverse_map_file
from strainfmu.cosim import flight_model as flight_model_file
from strainfmu.cosim.flight_model import FlightModel, check_envelope, save_flight_model
from strainfmu.cosim.master import matching_connections, simulate
from strainfmu.cosim.recording import Recording, load_recording, save_csv, save_hdf5
from strainfmu.cosim.system import System
from strainfmu.cosim.trajectory import Trajectory, load_trajectory
from strainfmu.files import write_bytes_atomically
from strainfmu.fmu.export import export_estimator, export_plant
from strainfmu.inverse_map import COEFFICIENT_NAMES, load_inverse_map, save_inverse_map

ROUND_OFF = 1e-9

COMMUNICATION_STEP_SIZE = 0.01
"""Time between communication points of the demonstration flight [s]: 100 Hz."""


@dataclass(frozen=True)
class DemoResult:
    """What a run of the whole way left behind.

    Attributes
    ----------
    vehicle : name of the vehicle.
    folder : where the files are.
    files : names of the files, in the order of the way, with what each holds.
    reused : those that were up to date already.
    score : how well the flown FMU did.
    """

    vehicle: str
    folder: Path
    files: dict[str, str]
    reused: tuple[str, ...]
    score: FlightScore


class _Chain:
    """The links made so far, and the means to make the next."""

    def __init__(self, vehicle: Vehicle, workspace: Workspace, reporter: Reporter) -> None:
        self.vehicle, self.workspace, self.reporter = vehicle, workspace, reporter
        self.files: dict[str, str] = {}
        self.reused: list[str] = []
        self.map_parts: tuple[Snapshots, AnyStructure] | None = None

    def link(self, name: str, holds: str, inputs: dict[str, Any], make: Any) -> None:
        """Make ``name`` or reuse it, and say so if it is reused."""
        if self.workspace.ensure(name, inputs, make):
            self.reused.append(name)
            self.reporter.note(f"{name}: up to date, reused")
        self.files[name] = holds

    def made_from(self, *names: str) -> list[str]:
        return [self.workspace.made_from(name) for name in names]


def run_demo(vehicle_path: Path, folder: Path, reporter: Reporter) -> DemoResult:
    """Go the whole way for one vehicle file and return what was made.

    Raises
    ------
    InputError
        The vehicle file, or a file it names, is wrong, or a condition is outside the solver's reach.
    StrainfmuError
        A file could not be written or an FMU failed.
    """
    vehicle = load_vehicle(vehicle_path)
    # Refused before the long work, not after it.
    check_map_size(vehicle, check_gauges(vehicle)[vehicle.gauges.layout])
    check_noise(vehicle)
    # The vehicle that flies is played by the Fourier model, whatever the map is built on.
    refuse_beyond_fourier(vehicle, [vehicle.gauges.layout])
    manoeuvre = vehicle.beside(vehicle.truth.manoeuvre)
    check_envelope(*truth_knots(vehicle), load_trajectory(manoeuvre), manoeuvre)
    _note_extrapolation(vehicle, load_trajectory(manoeuvre), reporter)
    chain = _Chain(vehicle, Workspace(folder), reporter)
    if vehicle.structure.model == "solid":
        _solid_structure(chain)
    _snapshots(chain)
    _inverse_map(chain)
    _flight_model(chain)
    _fmus(chain)
    recording = _flight(chain)
    score = score_flight(recording)
    _figures(chain, recording)
    _summary(chain, score)
    return DemoResult(vehicle.name, folder, chain.files, tuple(chain.reused), score)


def _note_extrapolation(vehicle: Vehicle, trajectory: Trajectory, reporter: Reporter) -> None:
    """Say where the manoeuvre leaves the range of the snapshots: there the stated sigmas need not hold."""
    flown = trajectory.conditions
    ranges = (
        ("Mach number", flown[:, 0], vehicle.conditions.mach_number, ""),
        ("angle of attack", np.degrees(flown[:, 1]), vehicle.conditions.angle_of_attack_deg, " deg"),
        ("sideslip angle", np.degrees(flown[:, 2]), vehicle.conditions.sideslip_angle_deg, " deg"),
        ("altitude", 1e-3 * flown[:, 3], [vehicle.conditions.altitude_km], " km"),
    )
    for name, values, known, unit in ranges:
        low, high = float(values.min()), float(values.max())
        if low < min(known) - ROUND_OFF or high > max(known) + ROUND_OFF:
            reporter.note(
                f"warning: the manoeuvre flies {name} {low:.4g} to {high:.4g}{unit}, the snapshots cover "
                f"{min(known):.4g} to {max(known):.4g}{unit}: outside, sigmas need not hold"
            )


def run_build(vehicle_path: Path, folder: Path, reporter: Reporter) -> Path:
    """Go as far as the inverse map, report on it beside it, and return the map's path.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`run_demo`.
    """
    vehicle = load_vehicle(vehicle_path)
    check_map_size(vehicle, check_gauges(vehicle)[vehicle.gauges.layout])
    check_noise(vehicle)
    chain = _Chain(vehicle, Workspace(folder), reporter)
    if vehicle.structure.model == "solid":
        _solid_structure(chain)
    _snapshots(chain)
    _inverse_map(chain)
    _report(chain)
    return chain.workspace.path("map.h5")


def _snapshots(chain: _Chain) -> None:
    vehicle = chain.vehicle
    engine = make_engine(vehicle, None, vehicle.resolution.map, note=chain.reporter.note)
    campaign = vehicle_campaign(vehicle, engine)
    surface = campaign.engine.surface

    def make(path: Path) -> None:
        result = run_campaign(campaign, path, Scheduling(), chain.reporter)
        for note in campaign_notes(result):
            chain.reporter.note(note)

    inputs = {
        "schema_version": snapshots_file.SCHEMA_VERSION,
        "vehicle": vehicle.name,
        "engine": campaign.engine.inputs(),
        "engine_entries": vehicle.aerodynamics.model_dump(),
        "surface": sha256(surface.point.tobytes() + surface.triangle.tobytes()).hexdigest(),
        "conditions": [condition.as_tuple() for condition in campaign.conditions],
        "flows": [campaign.engine.flow_key(condition) for condition in campaign.conditions],
        "internal_pressure": campaign.internal_pressure,
        "reference": asdict(campaign.reference),
    }
    chain.link("snapshots.h5", "surface pressure at every flight condition", inputs, make)


def _structural_inputs(vehicle: Vehicle) -> dict[str, Any]:
    """Return the entries of the vehicle file that strains and coefficients depend on."""
    tables = {
        name: vehicle.beside(entry.file).read_bytes().hex()
        for name, entry in vehicle.gauges.layouts.items()
        if entry.file is not None and vehicle.beside(entry.file).is_file()
    }
    for name in ("covariance_file", "nuisance_file"):
        file = getattr(vehicle.noise, name)
        if file is not None and vehicle.beside(file).is_file():
            tables[f"noise.{name}"] = vehicle.beside(file).read_bytes().hex()
    parts = vehicle.model_dump(include={"name", "structure", "material", "reference", "gauges", "noise", "map"})
    return {**parts, "tables": tables}


def _solid_structure(chain: _Chain) -> None:
    case = solid_case(chain.vehicle, used_layouts(chain.vehicle))

    def make(path: Path) -> None:
        used = update_structure(path, case, chain.reporter)[0].statistics
        size, solver = used["degrees_of_freedom"], used["solver"]
        chain.reporter.note(f"{size} dofs; solver {solver}, licence {used['licence']}")

    inputs = {"schema_version": structure_file.SCHEMA_VERSION, **case.made_from()}
    chain.link(
        "structure.h5",
        "strain per pressure of the three-dimensional structure",
        inputs,
        make,
    )


def _structure(chain: _Chain, snapshots: Snapshots) -> AnyStructure:
    """Return strain per pressure by the model that the vehicle file asks for."""
    vehicle = chain.vehicle
    if vehicle.structure.model == "solid":
        with chain.reporter.stage("Structure: pressure onto its surface"):
            return mapped_structure(load_structure(chain.workspace.path("structure.h5")), snapshots)
    with chain.reporter.stage("Structure: strain per pressure") as progress:
        return structural_model(vehicle, vehicle.resolution.map, used_layouts(vehicle), progress)


def _map_parts(chain: _Chain) -> tuple[Snapshots, AnyStructure]:
    """Return what the map is made from, solved once per run."""
    if chain.map_parts is None:
        snapshots = load_snapshots(chain.workspace.path("snapshots.h5"))
        chain.map_parts = snapshots, _structure(chain, snapshots)
    return chain.map_parts


def _inverse_map(chain: _Chain) -> None:
    vehicle = chain.vehicle

    def make(path: Path) -> None:
        snapshots, structure = _map_parts(chain)
        inverse_map = build_inverse_map(vehicle, snapshots, structure)
        held = inverse_map.provenance
        chain.reporter.note(
            f"{inverse_map.n_gauges} gauges, sigma {1e6 * inverse_map.noise_std[0]:.3g} um/m; "
            f"{held['modes']} modes hold {held['energy_of_modes']:.2%} of the energy"
        )
        if vehicle.structure.model == "solid":
            solid = load_structure(chain.workspace.path("structure.h5"))
            chain.reporter.note(mesh_error_line(solid, float(inverse_map.noise_std[0])))
        save_inverse_map(inverse_map, path)

    inputs = {
        "schema_version": inverse_map_file.SCHEMA_VERSION,
        "snapshots": chain.made_from("snapshots.h5"),
        "resolution": vehicle.resolution.map.model_dump(),
        **_structural_inputs(vehicle),
    }
    if vehicle.structure.model == "solid":
        inputs["structure"] = chain.made_from("structure.h5")
    chain.link("map.h5", "the inverse map: strain to loads, with covariance", inputs, make)


def _report(chain: _Chain) -> None:
    """Say what the map and its gauges can and cannot do: a page, and its numbers."""

    @cache
    def report() -> BuildReport:
        snapshots, structure = _map_parts(chain)
        inverse_map = load_inverse_map(chain.workspace.path("map.h5"))
        with chain.reporter.stage("Report: what the gauges tell"):
            found = build_report(chain.vehicle, snapshots, structure, inverse_map)
        chain.reporter.note(build_page.blind_line(found))
        return found

    def page(path: Path) -> None:
        found = report()
        with chain.reporter.stage("Report: figures"):
            build_page.write_report_page(found, path)

    def numbers(path: Path) -> None:
        build_page.write_numbers(report(), path.parent)

    inputs = {"map": chain.made_from("map.h5"), "schema_version": build_page.SCHEMA_VERSION}
    chain.link(build_page.JSON_NAME, "numbers of the report; report_tables holds them as CSV", inputs, numbers)
    if find_spec("matplotlib") is None:
        chain.reporter.note(f"{build_page.PAGE_NAME}: not made, its figures need strainfmu[report]")
        return
    chain.link(
        build_page.PAGE_NAME,
        "report: what this layout sees, how sure the map is, what gauges are worth",
        inputs,
        page,
    )


def _flight_model(chain: _Chain) -> None:
    vehicle, settings = chain.vehicle, chain.vehicle.resolution.truth

    def make(path: Path) -> None:
        engine, title = truth_engine(vehicle), "Flow: the vehicle that flies"
        with Journal(path) as journal:
            flows, _ = complete_flows(
                engine, truth_keys(vehicle), journal, {}, Scheduling(), chain.reporter, title
            )
            save_flight_model(_assembled(flows), path)
            journal.remove()

    def _assembled(flows: Mapping[FlowKey, Flow]) -> FlightModel:
        with chain.reporter.stage("Structure: the vehicle that flies") as progress:
            structure = structural_model(vehicle, settings, [vehicle.gauges.layout], progress)
        noise_std = float(load_inverse_map(chain.workspace.path("map.h5")).noise_std[0])
        return flight_model(vehicle, flows, structure, noise_std)

    inputs = {
        "schema_version": flight_model_file.SCHEMA_VERSION,
        "map": chain.made_from("map.h5"),
        "truth": vehicle.truth.model_dump(include={"mach_number", "total_incidence_deg"}),
        "resolution": settings.model_dump(),
    }
    chain.link("flight_model.h5", "the independent, finer model of the vehicle", inputs, make)


def _fmus(chain: _Chain) -> None:
    workspace, vehicle = chain.workspace, chain.vehicle
    trajectory = vehicle.beside(vehicle.truth.manoeuvre)
    with chain.reporter.stage("FMUs") as progress:
        chain.link(
            "estimator.fmu",
            "FMI 2.0 co-simulation FMU, native: strains in, coefficients out",
            {"map": chain.made_from("map.h5"), "kind": "native"},
            lambda path: export_estimator(workspace.path("map.h5"), path),
        )
        progress(1, 2)
        chain.link(
            "plant.fmu",
            "FMI 2.0 co-simulation FMU: the vehicle on its manoeuvre, noisy strains out",
            {"flight_model": chain.made_from("flight_model.h5"), "trajectory": trajectory.read_bytes().hex()},
            lambda path: export_plant(workspace.path("flight_model.h5"), trajectory, path),
        )
        progress(2, 2)


def _flight(chain: _Chain) -> Recording:
    workspace, vehicle = chain.workspace, chain.vehicle
    trajectory = load_trajectory(vehicle.beside(vehicle.truth.manoeuvre))
    fmus = {name: workspace.path(f"{name}.fmu") for name in ("plant", "estimator")}

    def make(path: Path) -> None:
        system = System(fmus, matching_connections("plant", "estimator", fmus))
        stop_time = trajectory.stop_time
        with chain.reporter.stage("System simulation: plant -> estimator") as progress:
            recording = simulate(
                system,
                stop_time,
                COMMUNICATION_STEP_SIZE,
                progress=lambda time: progress(round(100 * time / stop_time), 100),
            )
        save_hdf5(recording, path)

    inputs = {"fmus": chain.made_from("plant.fmu", "estimator.fmu"), "step": COMMUNICATION_STEP_SIZE}
    chain.link("flight.h5", "every signal of the system simulation", inputs, make)
    recording = load_recording(workspace.path("flight.h5"))
    chain.link(
        "flight.csv",
        "the same as CSV",
        {"flight": chain.made_from("flight.h5")},
        lambda path: save_csv(recording, path),
    )
    return recording


def _figures(chain: _Chain, recording: Recording) -> None:
    vehicle, settings = chain.vehicle, chain.vehicle.resolution.map
    surface = surface_grid(vehicle.body(), settings.surface_stations, settings.surface_roll_angles)
    snapshots = snapshots_on(load_snapshots(chain.workspace.path("snapshots.h5")), surface)
    inverse_map = load_inverse_map(chain.workspace.path("map.h5"))
    title = vehicle.name
    of_pressure = {"snapshots": chain.made_from("snapshots.h5"), "title": title}
    of_all = {**of_pressure, "map": chain.made_from("map.h5"), "flight": chain.made_from("flight.h5")}
    drawings: list[tuple[str, str, dict[str, Any], Callable[[], figures.Figure]]] = [
        (
            "overview.png",
            "figure: load, gauges and estimate in one picture",
            of_all,
            lambda: figures.overview(snapshots, surface, inverse_map, recording, title),
        ),
        (
            "pressure_unrolled.png",
            "figure: pressure of three conditions on the unrolled surface",
            of_pressure,
            lambda: figures.pressure_unrolled(snapshots, surface, title),
        ),
        (
            "pressure_on_body.png",
            "figure: the same on the body",
            of_pressure,
            lambda: figures.pressure_on_body(snapshots, surface, title),
        ),
        (
            "gauges.png",
            "figure: gauge layout",
            {"map": chain.made_from("map.h5")},
            lambda: figures.gauges(inverse_map, surface),
        ),
        (
            "coefficients.png",
            "figure: estimated against true coefficients, 3 sigma bands",
            {"flight": chain.made_from("flight.h5"), "title": title},
            lambda: figures.coefficients(recording, title),
        ),
    ]
    with chain.reporter.stage("Figures") as progress:
        for done, (name, holds, inputs, draw) in enumerate(drawings, start=1):
            chain.link(name, holds, inputs, lambda path, draw=draw: figures.save(draw(), path))
            progress(done, len(drawings))


def _without_nan(value: Any) -> Any:
    """Turn NaN, which JSON has no word for, into None."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    return None if isinstance(value, float) and np.isnan(value) else value


def _summary(chain: _Chain, score: FlightScore) -> None:
    def make(path: Path) -> None:
        values = {
            key: dict(zip(COEFFICIENT_NAMES, value.tolist(), strict=True))
            if isinstance(value, np.ndarray)
            else value
            for key, value in asdict(score).items()
        }
        write_bytes_atomically(path, json.dumps(_without_nan(values), indent=1, allow_nan=False).encode())

    inputs = {"flight": chain.made_from("flight.h5")}
    chain.link("summary.json", "the table below, as numbers", inputs, make)
