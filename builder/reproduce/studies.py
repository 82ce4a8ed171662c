"""Studies of both cases in all set-ups, and the measurements that explain them: the contents of the report."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from builder.reproduce.case_1 import (
    Case1Map,
    Case1Study,
    FieldExample,
    case_1_map,
    field_example,
    pod_of,
    study_case_1,
)
from builder.reproduce.case_2 import (
    FieldStudy,
    GammaStudy,
    case_2_map,
    drawn_modes,
    load_readings,
    study_field,
    study_gamma,
)
from builder.reproduce.measurements import (
    ClassRow,
    CrimeRow,
    HoopRow,
    ReadingRow,
    ScatterRow,
    class_rows,
    crime_rows,
    hoop_rows,
    reading_rows,
    scatter_rows,
    span_row,
)
from builder.reproduce.paper_readings import READINGS, SHIPPED, SPANS, Reading
from builder.reproduce.protocol import EXAMPLES, HELD_OUT, NOISE_FREE_GAMMA, P1, P2, PUBLISHED_GAMMA
from builder.reproduce.published import PUBLISHED
from builder.reproduce.setups import SAME_MESH, Pressures, SetUp
from builder.reproduce.strain_models import FOURIER, HEXAHEDRA, RECOVERED, TETRAHEDRA, StrainModel
from builder.vehicle.flight_conditions import flow_key
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.files import open_hdf5, write_bytes_atomically, write_hdf5_atomically
from strainfmu.linear.pressure_modes import LowRankPrior, prior_of_snapshots
from strainfmu.records import read_record, write_record

Progress = Callable[[int, int], None]

SCATTERS = [0.0, 1e-4, 1e-3, 1e-2]
"""Scatter of the pressures, over their value, for which the eigenvalues are computed."""

LAYOUT_2, LAYOUT_45 = "configuration_2", "configuration_45"

FIELDS = {
    # Name: condition, layout, gamma, noise.
    "noise_free": ("m5_a6_b6", LAYOUT_2, NOISE_FREE_GAMMA, False),
    "noisy": ("m5_a6_b6", LAYOUT_2, PUBLISHED_GAMMA, True),
    "off_set": ("m6_a0_b5", LAYOUT_2, PUBLISHED_GAMMA, True),
    "noise_free_45": ("m5_a6_b6", LAYOUT_45, NOISE_FREE_GAMMA, False),
    "noisy_45": ("m5_a6_b6", LAYOUT_45, PUBLISHED_GAMMA, True),
    "off_set_45": ("m6_a0_b5", LAYOUT_45, PUBLISHED_GAMMA, True),
}
"""The estimated fields of Case 2."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DrawnModes:
    """(n_p, 5) eigenvectors that the source draws, of unit norm."""

    modes: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Measurements:
    """One list of rows per cause.

    Attributes
    ----------
    readings : of the gauges' rows, per model.
    spans : the shipped and the best reading with rows of other first and last stations.
    hoop : fraction of the hoop strain that each model returns.
    crime : the noise-free example for pairs of models.
    classes : response of the layouts per symmetry class.
    scatter : the eigenvalues with scattered snapshots.
    surface_nodes, dofs : sizes.
    sigma : per set-up [m/m].
    conditions_left_out : number of conditions of P2 that the independent set-up leaves out.
    """

    readings: list[ReadingRow]
    spans: list[ReadingRow]
    hoop: list[HoopRow]
    crime: list[CrimeRow]
    classes: list[ClassRow]
    scatter: list[ScatterRow]
    surface_nodes: int
    dofs: dict[str, int]
    sigma: dict[str, float]
    conditions_left_out: int


@dataclass(frozen=True, eq=False, kw_only=True)
class Studies:
    """All results; studies by ``"set-up-what"``."""

    case_1: dict[str, Case1Study]
    examples: dict[str, FieldExample]
    gamma: dict[str, GammaStudy]
    fields: dict[str, FieldStudy]
    modes: FloatArray
    measured: Measurements


def run_case_1(
    setups: Mapping[str, SetUp], pressures: Pressures, path: Path, progress: Progress | None = None
) -> None:
    """Study Case 1 in all set-ups and both configurations, and write the studies to ``path``."""
    modes = pod_of(pressures.p1, None)
    example_1 = EXAMPLES["m5_a6_b5"]
    is_other = np.array([flow_key(condition) != flow_key(example_1) for condition in P1.conditions])
    without = pod_of(pressures.p1[is_other], None)
    studies: dict[str, Any] = {}
    for done, (key, setup) in enumerate(setups.items(), start=1):
        fields = pressures.fine_examples if setup.held_out else pressures.examples
        tested = (pressures.held_out, HELD_OUT) if setup.held_out else (pressures.p1, P1)
        maps = {n: case_1_map(modes, setup, SHIPPED.configuration(n), pressures.internal) for n in (1, 2)}
        for number, case in maps.items():
            studies[f"study/{key}-{number}"] = study_case_1(case, pressures, tested[0], tested[1].conditions)
        used = without if setup.held_out else modes
        first = case_1_map(used, setup, SHIPPED.configuration(1), pressures.internal)
        for name, case in (("m5_a6_b5", first), ("m7_a2_b8", maps[2])):
            studies[f"example/{key}-{name}"] = _example(case, name, fields, pressures.internal)
        if progress is not None:
            progress(done, len(setups))
    save_studies(studies, path)


def _example(case: Case1Map, name: str, fields: FloatArray, internal: float) -> FieldExample:
    return field_example(case, fields[list(EXAMPLES).index(name)], internal)


def run_case_2(
    setups: Mapping[str, SetUp],
    pressures: Pressures,
    grid: SurfaceGrid,
    layouts: Mapping[str, list[str]],
    path: Path,
    progress: Progress | None = None,
) -> None:
    """Study Case 2 in all set-ups, the published layout and "45", and write the studies to ``path``."""
    readings = load_readings(pressures.reference.moment_station)
    priors = {False: prior_of_snapshots(pressures.p2), True: prior_of_snapshots(pressures.p2[~left_out()])}
    studies: dict[str, Any] = {}
    for done, (key, setup) in enumerate(setups.items(), start=1):
        prior = priors[setup.held_out]
        maps = {name: case_2_map(prior, setup, names, pressures.internal) for name, names in layouts.items()}
        fields = pressures.fine_examples if setup.held_out else pressures.examples
        ensemble = (pressures.held_out if setup.held_out else pressures.p2) - pressures.internal
        flight = fields[list(EXAMPLES).index("m5_a6_b6")] - pressures.internal
        for layout, suffix in ((LAYOUT_2, ""), (LAYOUT_45, "-45")):
            read = maps[layout].data_operator.T
            studies[f"gamma/{key}{suffix}"] = study_gamma(maps[layout], ensemble @ read, flight @ read)
        for what, (condition, layout, gamma, noisy) in FIELDS.items():
            tested = fields[list(EXAMPLES).index(condition)]
            studies[f"field/{key}-{what}"] = study_field(maps[layout], tested, gamma, noisy, grid, readings)
        if key == SAME_MESH:
            studies["modes/drawn"] = DrawnModes(modes=drawn_modes(maps[LAYOUT_2]))
        if progress is not None:
            progress(done, len(setups))
    save_studies(studies, path)


def left_out() -> NDArray[np.bool_]:
    """Return (243,) which of P2 share the flow of the example M5 a6 b6: itself and its mirror images."""
    example = flow_key(EXAMPLES["m5_a6_b6"])
    return np.array([flow_key(condition) == example for condition in P2.conditions])


def run_measurements(
    models: Mapping[str, StrainModel],
    spans: Mapping[str, StrainModel],
    setups: Mapping[str, SetUp],
    pressures: Pressures,
    grid: SurfaceGrid,
    layouts: Mapping[str, list[str]],
    area: FloatArray,
    path: Path,
) -> None:
    """Measure the causes and write them as JSON to ``path``.

    Parameters
    ----------
    models : by name: both readings of the tetrahedra, hexahedra, Fourier.
    spans : the Fourier model with rows of other spans.
    area : (n_p,) of the nodes [m2].
    """
    prior = prior_of_snapshots(pressures.p2)
    solid = {name: models[name] for name in (TETRAHEDRA, HEXAHEDRA)}
    rows = reading_rows(solid, pressures)
    best = best_reading(rows, HEXAHEDRA)
    measured = Measurements(
        readings=rows,
        spans=[
            span_row(span, model, pressures, reading)
            for span, model in {next(iter(SPANS)): models[FOURIER], **spans}.items()
            for reading in dict.fromkeys((SHIPPED, best))
        ],
        hoop=hoop_rows(
            {name: models[name] for name in (TETRAHEDRA, RECOVERED, HEXAHEDRA)}, models[FOURIER], pressures
        ),
        crime=_crimes(models, layouts[LAYOUT_2], prior, pressures, grid),
        classes=[
            row for name in (HEXAHEDRA, TETRAHEDRA) for row in class_rows(models[name], layouts, prior, grid, area)
        ],
        scatter=scatter_rows(models[HEXAHEDRA], layouts[LAYOUT_2], pressures, SCATTERS),
        surface_nodes=pressures.p1.shape[1],
        dofs={name: int(model.facts["dofs"]) for name, model in models.items() if "dofs" in model.facts},
        sigma={key: setup.sigma for key, setup in setups.items()},
        conditions_left_out=int(left_out().sum()),
    )
    write_bytes_atomically(path, json.dumps(asdict(measured), indent=1).encode())


def best_reading(rows: list[ReadingRow], model: str) -> Reading:
    """Return the reading whose K1/K2 is nearest to the published one."""
    published = PUBLISHED["k_ratio"].low or 0.0
    distance = {row.reading: abs(np.log(row.ratio / published)) for row in rows if row.model == model}
    return min(READINGS, key=lambda reading: distance[reading.name])


def _crimes(
    models: Mapping[str, StrainModel],
    names: list[str],
    prior: LowRankPrior,
    pressures: Pressures,
    grid: SurfaceGrid,
) -> list[CrimeRow]:
    """Return the noise-free example with map and data of one model, then of two."""
    pairs = [
        (TETRAHEDRA, TETRAHEDRA),
        (RECOVERED, RECOVERED),
        (HEXAHEDRA, HEXAHEDRA),
        (FOURIER, FOURIER),
        (HEXAHEDRA, FOURIER),
        (TETRAHEDRA, RECOVERED),
        (TETRAHEDRA, FOURIER),
    ]
    return crime_rows([(models[a], models[b]) for a, b in pairs], names, prior, pressures, grid)


def load_all(case_1: Path, case_2: Path, measurements: Path) -> Studies:
    """Read the results that the stages wrote.

    Raises
    ------
    InputError
        A file is missing or damaged.
    """
    try:
        saved = json.loads(measurements.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{measurements}: cannot be read") from error
    kinds: dict[str, Any] = {
        "readings": ReadingRow,
        "spans": ReadingRow,
        "hoop": HoopRow,
        "crime": CrimeRow,
        "classes": ClassRow,
        "scatter": ScatterRow,
    }
    rows = {name: [kind(**row) for row in saved[name]] for name, kind in kinds.items()}
    return Studies(
        case_1=load_studies(Case1Study, case_1, "study"),
        examples=load_studies(FieldExample, case_1, "example"),
        gamma=load_studies(GammaStudy, case_2, "gamma"),
        fields=load_studies(FieldStudy, case_2, "field"),
        modes=load_studies(DrawnModes, case_2, "modes")["drawn"].modes,
        measured=Measurements(**{**saved, **rows}),
    )


Record = TypeVar("Record")

SCHEMA = "strainfmu.reproduce.studies"
SCHEMA_VERSION = 4

UNITS = {"reference": "Pa", "estimate": "Pa", "projection": "Pa"}


def save_studies(studies: Mapping[str, Any], path: Path) -> None:
    """Write records atomically, each in the group of its name, such as ``independent/configuration_1``."""

    def fill(file: h5py.File) -> None:
        for name, record in studies.items():
            write_record(file.create_group(name), record, UNITS)

    write_hdf5_atomically(path, SCHEMA, SCHEMA_VERSION, fill)


def load_studies(kind: type[Record], path: Path, folder: str) -> dict[str, Record]:
    """Read the records of one ``folder`` of the file, all of type ``kind``, by name.

    Raises
    ------
    InputError
        The file is missing, damaged, or holds no such folder.
    """
    with open_hdf5(path, SCHEMA, SCHEMA_VERSION) as file:
        if folder not in file:
            raise InputError(f"{path}: holds no '{folder}'")
        return {name: read_record(kind, group) for name, group in file[folder].items()}
