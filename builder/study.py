"""The file of a trade study (``study.toml``): a vehicle, entries that are set, entries that are swept, the trial.

.. code-block:: toml

    vehicle = "my_vehicle.toml"            # next to this file
    [set]
    "map.estimator" = "linear"
    [sweep]                                # all combinations
    "structure.wall_thickness_mm" = [3.0, 4.0, 5.0]
    "map.modes" = [3, 5]
    [trial]
    conditions = 200
    draws = 5
    seed = 1

Names of entries are as in messages on the vehicle file: ``section.entry``, items of lists by their number.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from builder.figures.comparison import trade_study_figure
from builder.figures.drawing import save
from builder.pipeline.map_files import make_independent_flows, make_map, make_snapshots
from builder.pipeline.pipeline import FLOWS, MAP, SNAPSHOTS, STRUCTURE, FilesGiven, Pipeline, open_pipeline
from builder.pipeline.progress_bars import AnyProgress, reporter_of
from builder.pipeline.stages import check_before_long_work, make_shape_flows
from builder.pipeline.trials import shape_conditions, world_of
from builder.processors import processors
from builder.reporting import Reporter, Silent
from builder.trial.cases import Case, Plan
from builder.trial.levels import HARDWARE
from builder.trial.readings import World
from builder.trial.run import Task, run_tasks, scored, tasks_of
from builder.trial.score import Row
from builder.trial.table import write_table
from builder.truth.shape import refuse_without_independent_model
from builder.vehicle.file import Vehicle, load_vehicle
from builder.vehicle.toml.reading import read_sections
from builder.vehicle.toml.toml_sections import Section
from builder.workspace import Cache, Workspace
from strainfmu.errors import FaultsError, InputError, StrainfmuError
from strainfmu.estimator.signal_names import TEMPERATURE
from strainfmu.files import fingerprint
from strainfmu.version import __version__

MOST_DESIGNS = 10_000
"""Designs of one study at most."""

TABLE, FIGURE, SCORES, TRIAL_FLOWS = "study.csv", "study.png", "scores", "trial_flows.h5"

VERSION = 2
"""Raised whenever the scores change otherwise than by their inputs, so that they are made again."""

MEMORY_LIMIT = "6 GiB"
"""Of one local worker."""

NOT_OF_FLOWS = {
    "description",
    "material",
    "materials",
    "gauges",
    "noise",
    "map",
    "calibration",
    TEMPERATURE,
    "mass",
    "structure",
}
"""Sections that change no flow; the pressure inside the body apart."""

Single = bool | int | float | str
Value = Single | list[Single]


class Trial(Section):
    """On what each design is tried.

    ``conditions`` flight conditions of the independent model inside the envelope, at each ``draws`` vehicles with
    installation errors and noise of their own.
    """

    conditions: int = Field(default=200, ge=1, le=100_000)
    draws: int = Field(default=5, ge=1, le=10_000)
    seed: int = Field(default=1, ge=0, le=2**31 - 1)

    @property
    def plan(self) -> Plan:
        """The plan of a trial by it."""
        return Plan(conditions=self.conditions, vehicles=self.draws, seed=self.seed)


class StudyFile(Section):
    """The whole file; ``set`` and ``sweep`` are by the names of entries of the vehicle file."""

    vehicle: str
    set: dict[str, Value] = Field(default_factory=dict)
    sweep: dict[str, Annotated[list[Value], Field(min_length=1)]] = Field(min_length=1)
    trial: Trial = Trial()


class Design(Section):
    """One design: its number from 1 on, and the ``values`` of the entries that are swept."""

    number: int
    values: dict[str, Value]

    @property
    def name(self) -> str:
        """The folder of the design."""
        return f"design_{self.number:04d}"

    @property
    def text(self) -> str:
        """The values, as a user wrote them."""
        return ", ".join(f"{name} = {value}" for name, value in self.values.items())


def load_study(path: Path) -> StudyFile:
    """Read and check a file of a study.

    Raises
    ------
    InputError
        The file is missing, no TOML, or wrong: one line for each entry.
    """
    study_file = read_sections(path, StudyFile, "file of a trade study", _faults)
    vehicle = path.parent / study_file.vehicle
    if not vehicle.is_file():
        raise InputError(f"{path}: vehicle: expected a vehicle file next to it, got '{study_file.vehicle}'")
    return study_file


def _faults(study: StudyFile) -> list[str]:
    both = sorted(study.set.keys() & study.sweep.keys())
    faults = [f"sweep.{name}: expected in one of [set] and [sweep], got both" for name in both]
    for name, values in study.sweep.items():
        if len({repr(value) for value in values}) < len(values):
            faults.append(f"sweep.{name}: expected each value once, got {values}")
    count = prod(len(values) for values in study.sweep.values())
    if count > MOST_DESIGNS:
        faults.append(f"sweep: expected at most {MOST_DESIGNS} combinations, got {count}")
    return faults


def designs_of(study: StudyFile) -> list[Design]:
    """Return all combinations of the values, the last entry changing first."""
    combinations = product(*study.sweep.values())
    return [
        Design(number=number, values=dict(zip(study.sweep, values, strict=True)))
        for number, values in enumerate(combinations, start=1)
    ]


def vehicle_of(path: Path, study: StudyFile, design: Design) -> Vehicle:
    """Return the vehicle of a design, which has an independent model.

    Raises
    ------
    InputError
        An entry is unknown, or a value outside its limits: the lines name study and design.
    """
    changes: dict[str, Any] = {**study.set, **design.values}
    try:
        vehicle = load_vehicle(path.parent / study.vehicle, changes)
        refuse_without_independent_model(vehicle)
        check_before_long_work(vehicle, len(vehicle.flight_conditions()))
        return vehicle
    except InputError as error:
        lines = [f"{path}: design {design.number} ({design.text}): {line}" for line in error.lines]
        raise FaultsError("\n".join(lines)) from error


@dataclass(frozen=True, eq=False, kw_only=True)
class StudyResult:
    """The table, a line for each design that was not scored, and the files that were written."""

    rows: list[Row]
    faults: list[str]
    files: list[Path]


def run_study(
    file: str | Path,
    output: str | Path = "study",
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: AnyProgress = None,
) -> StudyResult:
    """Build and fly a vehicle with other values of its entries: one table of all combinations.

    The file names the vehicle file and the entries that are swept. Each combination is a design: its map is built
    and estimates the flights of vehicles of the truth model, with installation errors and noise drawn.

    Writes study.csv, study.parquet (with pyarrow) and study.png, and the map of each design in its own folder.
    Designs that share flows solve them once. An interrupted study continues, and a second run reuses what is up to
    date.

    On the command line::

        strainfmu study study.toml -o study
        strainfmu study study.toml -o study --workers 1

    Parameters
    ----------
    file : file of the study (study.toml).
    output : folder for the results.
    workers : designs at a time on this machine. Default: the number of processors.
    scheduler : Dask scheduler, such as tcp://host:8786, whose workers share the folder.
    progress : True for progress bars.

    Raises
    ------
    InputError
        The study, or the vehicle of a design, is wrong.
    StrainfmuError
        A flow cannot be solved, a file not be written, or the workers are lost.
    """
    path, folder, reporter = Path(file), Path(output), reporter_of(progress)
    study = load_study(path)
    designs = designs_of(study)
    vehicles = [vehicle_of(path, study, design) for design in designs]
    tasks = _tasks(study, designs, vehicles, folder.resolve(), reporter)
    scores = run_tasks(
        tasks,
        folder / SCORES,
        reporter,
        title="Designs",
        refused=(StrainfmuError,),
        workers=min(workers or processors(), len(tasks)),
        scheduler=scheduler,
        memory=MEMORY_LIMIT,
    )
    rows, faults = list[Row](), list[str]()
    for design, score in zip(designs, scores, strict=True):
        if isinstance(score, str):
            faults += [f"{design.name} ({design.text}): {line}" for line in score.split("\n")]
        else:
            rows += [{"design": design.number, **design.values, **row} for row in score]
    files = [folder / TABLE] if rows else []
    if rows and find_spec("pyarrow") is not None:
        files.append((folder / TABLE).with_suffix(".parquet"))
    for file in files:
        write_table(rows, file)
    if rows and find_spec("matplotlib") is not None:
        files.append(folder / FIGURE)
        save(trade_study_figure(rows, list(study.sweep)), folder / FIGURE)
    return StudyResult(rows=rows, faults=faults, files=files)


def _tasks(
    study: StudyFile, designs: Sequence[Design], vehicles: Sequence[Vehicle], folder: Path, reporter: Reporter
) -> list[Task]:
    """Return the tasks; flows are solved here, once for all designs that have the same."""
    shared: dict[str, Pipeline] = {}
    tasks = list[Task]()
    for design, vehicle in zip(designs, vehicles, strict=True):
        key = flows_key(vehicle)
        if key not in shared:
            pipeline = Pipeline(
                vehicle, Workspace(folder / f"flows_{len(shared) + 1:04d}", Cache(vehicle.beside("."))), reporter
            )
            make_snapshots(pipeline)
            if vehicle.is_axisymmetric:
                make_independent_flows(pipeline)
            shared[key] = pipeline
        flows, plan = shared[key], study.trial.plan
        table, made_from = None, flows.made_from(SNAPSHOTS)[0]
        if vehicle.is_axisymmetric:
            table, made_from = flows.path(FLOWS), flows.made_from(FLOWS)[0]
        files = folder / design.name, flows.path(SNAPSHOTS), table, made_from
        inputs = {
            "study": [VERSION, __version__],
            "flows": made_from,
            "design": design.number,
            "vehicle": vehicle.model_dump(exclude={"description"}),
        }
        world = partial(design_world, vehicle, plan, *files)
        tasks += tasks_of([HARDWARE], plan, world, inputs, design_rows)
    return tasks


def flows_key(vehicle: Vehicle) -> str:
    """Return what the flows of a vehicle follow from: designs of one key share them."""
    entries = vehicle.model_dump(exclude=NOT_OF_FLOWS)
    return fingerprint({**entries, "internal_pressure": vehicle.structure.internal_pressure_Pa})


def design_world(
    vehicle: Vehicle, plan: Plan, folder: Path, snapshots: Path, flows: Path | None, made_from: str
) -> World:
    """Build a design, or take what is up to date in its folder, and return its world.

    ``flows`` are the ones that it shares with others, of the content ``made_from``; None for flows of its own.
    """
    pipeline, _ = open_pipeline(vehicle, folder, Silent(), FilesGiven(snapshots=snapshots))
    if flows is not None:
        pipeline.use(FLOWS, flows, made_from)
    make_map(pipeline)
    vehicle = pipeline.flown or pipeline.vehicle
    if vehicle.sensors is not None:
        raise InputError("sensors: expected none, a trade study flies strain gauges alone")
    if flows is None:
        conditions = shape_conditions(vehicle, [HARDWARE], plan.conditions, plan.seed)
        make_shape_flows(pipeline, vehicle, conditions, TRIAL_FLOWS, "flows of the trial")
    structure = pipeline.path(STRUCTURE)
    files = pipeline.path(MAP), flows or pipeline.path(TRIAL_FLOWS), structure if structure.is_file() else None
    return world_of(vehicle, *files, plan)


def design_rows(world: World, case: Case, plan: Plan) -> dict[str, list[Row]]:
    """Return the rows of a design by estimator, with the number of its gauges."""
    rows = scored(world, case, plan)
    return {name: [{"gauges": world.inverse_map.n_gauges, **row} for row in rows[name]] for name in rows}
