"""From a vehicle file to its inverse map and the report on it, link by link."""

from __future__ import annotations

from dataclasses import asdict
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from builder.aero.engines import make_engine
from builder.campaign import snapshots as snapshots_file
from builder.campaign.notes import campaign_notes
from builder.campaign.run import run_campaign
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.campaign.vehicle_campaign import vehicle_campaign
from builder.inverse.build import AnyStructure, build_inverse_map, check_noise
from builder.pipeline.stages import Chain
from builder.reporting import Reporter
from builder.reports import build_page
from builder.reports.build_report import BuildReport, build_report
from builder.structure import structure_file
from builder.structure.mapped_structure import mapped_structure
from builder.structure.model import check_gauges, check_map_size, solid_case, structural_model, used_layouts
from builder.structure.solid.model import update_structure
from builder.structure.solid.reference_loads import mesh_error_line
from builder.structure.structure_file import load_structure
from builder.vehicle.file import Vehicle, load_vehicle
from builder.workspace import Workspace
from strainfmu.estimator import inverse_map as inverse_map_file
from strainfmu.estimator.inverse_map import load_inverse_map, save_inverse_map


def run_build(vehicle_path: Path, folder: Path, reporter: Reporter) -> Path:
    """Go as far as the inverse map, report on it beside it, and return the map's path.

    Raises
    ------
    InputError
        The vehicle file, or a file it names, is wrong, or a condition is outside the solver's reach.
    StrainfmuError
        A file could not be written.
    """
    vehicle = load_vehicle(vehicle_path)
    check_map_size(vehicle, check_gauges(vehicle)[vehicle.gauges.layout])
    check_noise(vehicle)
    chain = Chain(vehicle, Workspace(folder), reporter)
    make_map(chain)
    _report(chain)
    return chain.workspace.path("map.h5")


def make_map(chain: Chain) -> None:
    """Make the snapshots, the structure if it is a file of its own, and the map."""
    if chain.vehicle.structure.model == "solid":
        _solid_structure(chain)
    _snapshots(chain)
    _inverse_map(chain)


def _snapshots(chain: Chain) -> None:
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


def _solid_structure(chain: Chain) -> None:
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


def _structure(chain: Chain, snapshots: Snapshots) -> AnyStructure:
    """Return strain per pressure by the model that the vehicle file asks for."""
    vehicle = chain.vehicle
    if vehicle.structure.model == "solid":
        with chain.reporter.stage("Structure: pressure onto its surface"):
            return mapped_structure(load_structure(chain.workspace.path("structure.h5")), snapshots)
    with chain.reporter.stage("Structure: strain per pressure") as progress:
        return structural_model(vehicle, vehicle.resolution.map, used_layouts(vehicle), progress)


def _map_parts(chain: Chain) -> tuple[Snapshots, AnyStructure]:
    """Return what the map is made from, solved once per run."""
    if chain.map_parts is None:
        snapshots = load_snapshots(chain.workspace.path("snapshots.h5"))
        chain.map_parts = snapshots, _structure(chain, snapshots)
    return chain.map_parts


def _inverse_map(chain: Chain) -> None:
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


def _report(chain: Chain) -> None:
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
