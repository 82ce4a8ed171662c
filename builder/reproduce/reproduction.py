"""The reproduction of the source, stage by stage; a stage whose inputs have not changed is not run again."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from builder.aero.engines.euler import EulerEngine
from builder.aero.euler.planes import GRID_LEVELS
from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.campaign_run import run_campaign, vehicle_campaign
from builder.campaign.failures import refuse_missing
from builder.campaign.snapshots import SCHEMA_VERSION as SNAPSHOTS_VERSION
from builder.campaign.snapshots import Snapshots, load_snapshots
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.reporting import Progress, Reporter
from builder.reproduce.paper_readings import SHIPPED, SPANS, gauges_of_45, with_all_gauges
from builder.reproduce.parity import ParityRow, Verdict, parity_rows, verdicts
from builder.reproduce.protocol import HELD_OUT, P1, P2, PAPER, QUICK, TESTS, Sizes, sized
from builder.reproduce.report import write_report
from builder.reproduce.setups import SetUp, make_setups, pressures
from builder.reproduce.strain_models import (
    FOURIER,
    HEXAHEDRA,
    RECOVERED,
    TETRAHEDRA,
    StrainModel,
    fourier_model,
    hexahedral_model,
    load_model,
    save_model,
    tetrahedral_model,
)
from builder.reproduce.studies import (
    LAYOUT_2,
    LAYOUT_45,
    Studies,
    load_all,
    run_case_1,
    run_case_2,
    run_measurements,
)
from builder.reproduce.studies import SCHEMA_VERSION as STUDIES_VERSION
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.flight_conditions import ConditionSet
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from builder.workspace import Workspace

Solve = Callable[[Progress], StrainModel]


@dataclass(frozen=True)
class Reproduction:
    """The result of a run.

    Attributes
    ----------
    folder : where ``report.html``, ``numbers.json``, ``tables/`` and ``figures/`` are.
    parity : published numbers and ours.
    verdicts : the criteria.
    reused : files that were up to date.
    """

    folder: Path
    parity: list[ParityRow]
    verdicts: list[Verdict]
    reused: tuple[str, ...]


class _Stages:
    """The folder, the vehicle at the sizes of the run, and the files that were up to date."""

    def __init__(self, folder: Path, sizes: Sizes, reporter: Reporter) -> None:
        shipped = load_vehicle(IC3X)
        self.sizes, self.reporter = sizes, reporter
        self.vehicle = with_all_gauges(sized(shipped, sizes))
        self.layouts = {LAYOUT_2: SHIPPED.configuration(2), LAYOUT_45: gauges_of_45(shipped)}
        self.workspace = Workspace(folder)
        self.reused: list[str] = []

    def ensure(self, name: str, inputs: dict[str, Any], make: Callable[[Path], object]) -> Path:
        """Make ``name`` or reuse it; return its path."""
        # The scheduling of the flows does not change them.
        sizes = {name: value for name, value in asdict(self.sizes).items() if name != "scheduling"}
        inputs = {"sizes": sizes, "vehicle": self.vehicle.model_dump(mode="json"), **inputs}
        if self.workspace.ensure(name, inputs, make):
            self.reused.append(name)
            if "/" not in name:  # figures are reported by their stage
                self.reporter.note(f"{name}: up to date, reused")
        return self.workspace.path(name)

    def made_from(self, *names: str) -> list[str]:
        return [self.workspace.made_from(name) for name in names]


def reproduce_paper(
    output: str | Path = "reproduction", *, quick: bool = False, progress: AnyProgress = None
) -> Reproduction:
    """Reproduce the tables and figures of the source paper with the shipped vehicle.

    Three set-ups: linear tetrahedra as in the paper, a converged mesh, and data of another mesh than the map's.
    Writes report.html, numbers.json, ``tables/*.csv`` and ``figures/*.png``. A second run reuses what is up to
    date.

    On the command line::

        strainfmu reproduce --quick
        strainfmu reproduce -o paper

    Parameters
    ----------
    output : folder for the results.
    quick : coarse grids: minutes instead of a quarter of an hour.
    progress : True for progress bars.

    Raises
    ------
    InputError
        ``output`` is a file.
    StrainfmuError
        A file could not be written, a solver failed, or matplotlib is not installed.
    """
    folder, reporter = Path(output), reporter_of(progress)
    stages = _Stages(folder, QUICK if quick else PAPER, reporter)
    snapshots = _flows(stages, "snapshots.h5", [P1, P2, TESTS], stages.sizes.flow_grid)
    fine = _flows(stages, "held_out.h5", [HELD_OUT, TESTS], stages.sizes.held_out_grid)
    models, spans = _models(stages, snapshots)
    grid = snapshots.grid
    assert grid is not None  # the Euler engine's nodes are stations times roll angles
    studies = _studies(stages, snapshots, fine, models, spans, grid)
    with reporter.stage("Figures and report"):
        inputs = {"from": stages.made_from("snapshots.h5", "case_1.h5", "case_2.h5", "measurements.json")}
        station = stages.vehicle.reference.moment_station_m
        write_report(
            studies, grid, stages.sizes, station, folder, lambda name, make: stages.ensure(name, inputs, make)
        )
    return Reproduction(
        folder=folder, parity=parity_rows(studies), verdicts=verdicts(studies), reused=tuple(stages.reused)
    )


def _flows(stages: _Stages, name: str, sets: list[ConditionSet], level: str) -> Snapshots:
    vehicle = stages.vehicle
    body = vehicle.body()
    engine = EulerEngine(
        body=body,
        marching_grid=replace(GRID_LEVELS[level], corner="marched"),  # as the numbers in print were made
        grid=surface_grid(body, *vehicle.resolution.map.surface_nodes),
    )
    campaign = vehicle_campaign(vehicle, engine, sets)
    inputs = {
        "schema_version": SNAPSHOTS_VERSION,
        "engine": campaign.engine.inputs(),
        "surface": sha256(campaign.engine.surface.point.tobytes()).hexdigest(),
        "conditions": [condition.as_tuple() for condition in campaign.conditions],
    }
    path = stages.ensure(
        name, inputs, lambda path: run_campaign(campaign, path, stages.sizes.scheduling, stages.reporter)
    )
    snapshots = load_snapshots(path)
    refuse_missing(snapshots)  # rows are told apart by their number in the sets
    return snapshots


def _models(stages: _Stages, snapshots: Snapshots) -> tuple[dict[str, StrainModel], dict[str, StrainModel]]:
    """Return the models by name, and the Fourier model with rows of other spans."""
    vehicle, sizes = stages.vehicle, stages.sizes
    solvers: dict[str, Solve] = {
        FOURIER: _fourier(vehicle),
        HEXAHEDRA: lambda progress: hexahedral_model(vehicle, sizes, snapshots, progress),
        TETRAHEDRA: lambda progress: tetrahedral_model(vehicle, sizes, snapshots, False, progress),
        RECOVERED: lambda progress: tetrahedral_model(vehicle, sizes, snapshots, True, progress),
    }
    further = list(SPANS.items())[1:]
    for i, (_, span) in enumerate(further, start=1):
        solvers[f"{FOURIER}_span_{i}"] = _fourier(_with_span(vehicle, span))
    made = {name: _model(stages, name, solve) for name, solve in solvers.items()}
    spans = {label: made.pop(f"{FOURIER}_span_{i}") for i, (label, _) in enumerate(further, start=1)}
    return made, spans


def _fourier(vehicle: Vehicle) -> Solve:
    """Return the Fourier model's solution, which is too short for a bar of progress."""
    return lambda _: fourier_model(vehicle)


def _with_span(vehicle: Vehicle, span: tuple[float, float]) -> Vehicle:
    shipped = load_vehicle(IC3X)
    return with_all_gauges(shipped.model_copy(update={"resolution": vehicle.resolution}), span)


def _model(stages: _Stages, name: str, solve: Solve) -> StrainModel:
    def make(path: Path) -> None:
        with stages.reporter.stage(f"Structure: {name.replace('_', ' ')}") as progress:
            save_model(solve(progress), path)

    return load_model(
        stages.ensure(f"{name}.h5", {"spans": SPANS, "nodes": stages.made_from("snapshots.h5")}, make)
    )


def _studies(
    stages: _Stages,
    snapshots: Snapshots,
    fine: Snapshots,
    models: dict[str, StrainModel],
    spans: dict[str, StrainModel],
    grid: SurfaceGrid,
) -> Studies:
    flown = pressures(snapshots, fine)
    setups: dict[str, SetUp] = make_setups(
        models[TETRAHEDRA], models[HEXAHEDRA], models[FOURIER], flown.p1 - flown.internal
    )
    inputs = {
        "schema_version": STUDIES_VERSION,
        "from": stages.made_from("snapshots.h5", "held_out.h5", *(f"{name}.h5" for name in models)),
    }

    def staged(title: str, run: Callable[[Path, Progress], None]) -> Callable[[Path], None]:
        def make(path: Path) -> None:
            with stages.reporter.stage(title) as progress:
                run(path, progress)

        return make

    case_1 = stages.ensure(
        "case_1.h5",
        inputs,
        staged("Case 1", lambda path, progress: run_case_1(setups, flown, path, progress)),
    )
    case_2 = stages.ensure(
        "case_2.h5",
        inputs,
        staged("Case 2", lambda path, progress: run_case_2(setups, flown, grid, stages.layouts, path, progress)),
    )
    area = mesh_of_grid(grid).node_area
    measured = stages.ensure(
        "measurements.json",
        inputs,
        staged(
            "Measurements",
            lambda path, _: run_measurements(
                models=models,
                spans=spans,
                setups=setups,
                pressures=flown,
                grid=grid,
                layouts=stages.layouts,
                area=area,
                path=path,
            ),
        ),
    )
    return load_all(case_1, case_2, measured)
