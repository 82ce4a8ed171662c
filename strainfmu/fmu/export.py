"""Export of the two FMUs: the estimator of a map, and the plant of a flight model and a trajectory."""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

from strainfmu.archive import write_archive
from strainfmu.cosim.estimators.zeros_file import load_known_strain
from strainfmu.cosim.models import flight_model
from strainfmu.cosim.models.flight_model import check_envelope, load_flight_model
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.errors import InputError
from strainfmu.estimator.core import LIBRARIES_OF_FMU
from strainfmu.estimator.library_sources import sources_digest
from strainfmu.estimator.map.inverse_map import (
    SCHEMA,
    SCHEMA_VERSION,
    InverseMap,
    load_inverse_map,
    save_inverse_map,
)
from strainfmu.estimator.signal_names import STRAIN
from strainfmu.estimator.tare import KnownStrain
from strainfmu.files import built_time_of, content_hash_of, write_folder_atomically
from strainfmu.fmu.c_folder import c_entries, check_folder_path
from strainfmu.fmu.description.fmu_description import FmuDescription
from strainfmu.fmu.description.port import BusPart
from strainfmu.fmu.description.terminals import terminal_files
from strainfmu.fmu.documentation.estimator_page import estimator_sections
from strainfmu.fmu.documentation.index_page import documentation_files
from strainfmu.fmu.documentation.plant_page import plant_sections
from strainfmu.fmu.documentation.run_panels import reference_sections
from strainfmu.fmu.fmu_file import check_fmu_path
from strainfmu.fmu.native import package as native_package
from strainfmu.fmu.native.package import chosen_libraries, native_entries
from strainfmu.fmu.native.sources import compiled_files, native_sources
from strainfmu.fmu.python import package as python_package
from strainfmu.fmu.python.package import python_entries, slave_code
from strainfmu.fmu.reference_run.plant import python_plant_reference
from strainfmu.fmu.reference_run.run import (
    N_ROWS,
    STEP_SIZE,
    TRUTH,
    layered_standard_files,
    reference_run,
    signal_table,
)
from strainfmu.interface.contents import CONTENTS, estimator_contents
from strainfmu.interface.estimator_variables import estimator_arrays, estimator_interface
from strainfmu.interface.fmi_variables import Variable, value_references
from strainfmu.interface.listed_variables import (
    fed_by_frames,
    most_important_first,
    with_minimal_inputs,
    without_zeros,
)
from strainfmu.interface.plant_variables import plant_interface
from strainfmu.interface.sensor_variables import sensor_names
from strainfmu.version import __version__

KINDS = ("native", "python", "c")
FMI_VERSIONS = ("2", "3")
INPUTS = ("minimal", "full")

_COMMON_SOURCES = (
    "__init__.py",
    "__init__.pyi",
    "public_names.py",
    "version.py",
    "arrays.py",
    "atmosphere.py",
    "errors.py",
    "files.py",
    "flight_condition.py",
    "records.py",
    "fmu/__init__.py",
    "fmu/python/__init__.py",
    "fmu/python/stop_time.py",
    "fmu/python/wrapper_exit.py",
)
_ESTIMATOR_ROOMS = ("map", "reference", "resource")
_ESTIMATOR_SOURCES = (
    *_COMMON_SOURCES,
    "estimator/",
    *(f"estimator/{room}/" for room in _ESTIMATOR_ROOMS),
    "interface/",
    "resource_file.py",
)
"""Modules and, with a slash, whole rooms of the run-time that a slave imports, itself or through others."""
_PLANT_SOURCES = (
    *_COMMON_SOURCES,
    "estimator/__init__.py",
    "estimator/air_inputs.py",
    "estimator/map/__init__.py",
    "estimator/map/schema.py",
    "estimator/map/sensors.py",
    "estimator/settings.py",
    "estimator/signal_names.py",
    "interface/",
    "cosim/__init__.py",
    "cosim/models/__init__.py",
    "cosim/models/flight_model.py",
    "cosim/models/trajectory.py",
    "text_files.py",
)

_STEP_SIZE = 1e-2
_STOP_TIME = STEP_SIZE * (N_ROWS - 1)
"""That of the reference run."""


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """How an estimator FMU is made.

    Attributes
    ----------
    kind, scalars, inputs, estimator, tare_known : as :func:`strainfmu.export` takes them.
    fmi_version : 2 for FMI 2.0, 3 for FMI 3.0 (native only), as a number or a text.
    platforms : names of the platforms to support, by FMI 2.0 or 3.0; None for all (native only).
    model_name : name of the model that tools show.
    zero_inputs : whether an FMU of scalars lists zeros of the gauges, their standard deviations, and the zeros
        that a tare has taken; one of arrays always does.
    """

    kind: str = "native"
    fmi_version: str = "2"
    scalars: bool = False
    platforms: Sequence[str] | None = None
    model_name: str = "StrainLoadEstimator"
    inputs: str = "minimal"
    estimator: Literal["linear"] | None = None
    zero_inputs: bool = False
    tare_known: Path | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "fmi_version", str(self.fmi_version))
        if self.kind not in KINDS:
            raise InputError(f"kind: '{self.kind}' found, must be one of {', '.join(KINDS)}")
        if self.inputs not in INPUTS:
            raise InputError(f"inputs: '{self.inputs}' found, must be one of {', '.join(INPUTS)}")
        if self.estimator not in (None, "linear"):
            raise InputError(f"estimator: '{self.estimator}' found, must be linear or left out")
        if self.fmi_version not in FMI_VERSIONS:
            raise InputError(f"fmi: '{self.fmi_version}' found, must be one of {', '.join(FMI_VERSIONS)}")
        if self.kind == "python" and self.fmi_version != "2":
            raise InputError("fmi: 3 found, FMUs of kind python are of FMI 2.0")
        if self.scalars and self.fmi_version != "3":
            raise InputError(f"scalars: fmi {self.fmi_version} found, expected 3: FMI 2.0 has scalars alone")
        if self.kind == "python" and self.platforms is not None:
            raise InputError("platforms: FMUs of kind python have the platforms of PythonFMU, linux64 and win64")
        if self.kind == "c":
            self._check_for_c()

    def _check_for_c(self) -> None:
        """Refuse what sources without FMI do not have."""
        wrong = {
            "fmi": self.fmi_version != "2",
            "platforms": self.platforms is not None,
            "inputs": self.inputs != "minimal",
            "zero inputs": self.zero_inputs,
            "tare known": self.tare_known is not None,
        }
        for name in (name for name, stated in wrong.items() if stated):
            raise InputError(
                f"{name}: expected none with kind c, which is no FMU; its README.txt lists what it has"
            )


def export_estimator(
    map_path: str | PathLike[str],
    fmu_path: str | PathLike[str],
    options: ExportOptions | None = None,
    bus: Callable[[Path], BusPart] | None = None,
) -> Literal["linear", "nonlinear"]:
    """Write the estimator FMU of the map at ``map_path`` to ``fmu_path``; None takes the native kind of FMI 2.0.

    Returns which estimator it holds. Of kind "c" ``fmu_path`` is a new folder. ``bus`` returns for a map what puts
    its FMU on a bus, as :func:`strainfmu.packaging.nodes.export_ecu` does.

    Raises
    ------
    InputError
        The map is missing or damaged, an option cannot be, or there is something at the folder's name (kind c).
    StrainfmuError
        PythonFMU is not installed (kind python), or the FMU could not be written; ``fmu_path`` keeps its old
        content.

    Example
    -------
    >>> export_estimator(Path("demo/map.h5"), Path("arrays.fmu"), ExportOptions(fmi_version="3"))
    'nonlinear'
    """
    options = options or ExportOptions()
    map_path, fmu_path = Path(map_path), Path(fmu_path)
    if options.kind == "c":
        check_folder_path(fmu_path)
    else:
        check_fmu_path(fmu_path)
    inverse_map = load_inverse_map(map_path)
    if options.estimator == "linear" and inverse_map.manifold is not None:
        with TemporaryDirectory() as folder:
            linear = Path(folder) / "map.h5"
            build_date = built_time_of(map_path, SCHEMA, SCHEMA_VERSION)
            save_inverse_map(replace(inverse_map, manifold=None), linear, build_date)
            return export_estimator(linear, fmu_path, options, bus)
    content_hash = content_hash_of(map_path, SCHEMA, SCHEMA_VERSION)
    if options.kind == "c":
        write_folder_atomically(fmu_path, c_entries(inverse_map, content_hash))
    else:
        if options.kind == "native":
            part = None if bus is None else bus(map_path)
            entries = _native_estimator(map_path, inverse_map, content_hash, options, part)
        else:
            entries = _python_estimator(map_path, inverse_map, content_hash, options)
        write_archive(fmu_path, entries)
    return "linear" if inverse_map.manifold is None else "nonlinear"


def _listed(scalars: Sequence[Variable], inverse_map: InverseMap, options: ExportOptions) -> tuple[Variable, ...]:
    """Return the scalar variables that the description of the FMU lists."""
    n = inverse_map.n_strain_gauges
    return _in_order(scalars if options.zero_inputs else without_zeros(scalars, n), options)


def _in_order(interface: Sequence[Variable], options: ExportOptions) -> tuple[Variable, ...]:
    return most_important_first(interface if options.inputs == "full" else with_minimal_inputs(interface))


def _known_strain(options: ExportOptions, inverse_map: InverseMap) -> KnownStrain | None:
    if options.tare_known is None:
        return None
    return load_known_strain(options.tare_known, inverse_map.gauge_names[: inverse_map.n_strain_gauges])


def _known_bytes(known: KnownStrain | None) -> bytes:
    """Return what the slave of kind python reads of ``known``, and what its hash is taken of; b"" for None."""
    return b"" if known is None else json.dumps([known.value.tolist(), known.std.tolist()]).encode()


def _native_estimator(
    map_path: Path, inverse_map: InverseMap, content_hash: str, options: ExportOptions, bus: BusPart | None = None
) -> dict[str, bytes]:
    from strainfmu.estimator.resource.map_file import native_resource

    version = options.fmi_version
    libraries = chosen_libraries("estimator", options.platforms, version)
    sources = native_sources("estimator", version, on_bus=bus is not None)
    scalars, known = estimator_interface(inverse_map), _known_strain(options, inverse_map)
    arrays = estimator_arrays(scalars)
    of_arrays = version == "3" and not options.scalars
    digest = f"{content_hash}{sources_digest(sources)}".encode() + _known_bytes(known)
    listed = _in_order(arrays, options) if of_arrays else _listed(scalars, inverse_map, options)
    capabilities = native_package.CAPABILITIES[version]
    if bus is not None:
        digest += bus.content("") + repr(bus.ports).encode()
        listed, capabilities = fed_by_frames(listed), native_package.CAPABILITIES_ON_BUS
    has_model_exchange = inverse_map.manifold is None and bus is None
    description = FmuDescription(
        model_name=options.model_name,
        description=_described(inverse_map),
        interface=listed,
        content_hash=hashlib.sha256(digest).hexdigest(),
        stop_time=_STOP_TIME,
        step_size=_STEP_SIZE,
        capabilities=capabilities,
        fmi_version=version,
        source_files=compiled_files(sources),
        model_exchange=native_package.MODEL_EXCHANGE[version] if has_model_exchange else None,
        n_arrays=len(arrays) if options.scalars else None,
        build_date=built_time_of(map_path, SCHEMA, SCHEMA_VERSION),
        numbers=value_references(arrays if of_arrays else scalars),
        ports=() if bus is None else bus.ports,
    )
    return {
        **native_entries(
            description=description,
            libraries=libraries,
            sources=sources,
            resource_files={"map.bin": native_resource(inverse_map, description.guid, known)},
        ),
        **_estimator_extras(
            description=description, inverse_map=inverse_map, content_hash=content_hash, kind="native", bus=bus
        ),
    }


def _python_estimator(
    map_path: Path, inverse_map: InverseMap, content_hash: str, options: ExportOptions
) -> dict[str, bytes]:
    code, scalars = slave_code("estimator_slave", _ESTIMATOR_SOURCES), estimator_interface(inverse_map)
    known = _known_bytes(_known_strain(options, inverse_map))
    libraries = {
        f"{LIBRARIES_OF_FMU}/{native_package.FOLDERS[platform]}/estimator{suffix}": content
        for platform, (suffix, content) in chosen_libraries("estimator", None, "2").items()
    }
    made_of = b"".join((f"{content_hash}{code.digest}".encode(), known, *libraries.values()))
    payload = {"map.h5": map_path.read_bytes(), **libraries} | ({"tare_known.json": known} if known else {})
    description = FmuDescription(
        model_name=options.model_name,
        description=_described(inverse_map),
        interface=_listed(scalars, inverse_map, options),
        content_hash=hashlib.sha256(made_of).hexdigest(),
        stop_time=_STOP_TIME,
        step_size=_STEP_SIZE,
        capabilities=python_package.CAPABILITIES,
        numbers=value_references(scalars),
        build_date=built_time_of(map_path, SCHEMA, SCHEMA_VERSION),
    )
    return {
        **python_entries(description, code, payload),
        **_estimator_extras(
            description=description, inverse_map=inverse_map, content_hash=content_hash, kind="python"
        ),
    }


def _described(inverse_map: InverseMap) -> str:
    """Return in one line what the FMU of ``inverse_map`` does."""
    n = inverse_map.n_strain_gauges
    auxiliary = inverse_map.n_gauges - n
    sensors = f" and {auxiliary} auxiliary sensor{'s' if auxiliary > 1 else ''}" if auxiliary else ""
    return f"Aerodynamic loads from the strain of {n} gauges{sensors}: {inverse_map.vehicle}"


def _terminals(inverse_map: InverseMap) -> dict[str, tuple[tuple[str, ...], str]]:
    """Return arrays or variables, and the description, of each connector."""
    sensors = sensor_names(inverse_map)
    terminals: dict[str, tuple[tuple[str, ...], str]] = {"gauges": ((STRAIN,), "Strain of every gauge")}
    return terminals | {"sensors": (sensors, "What every auxiliary sensor reads")} if sensors else terminals


def _estimator_extras(
    description: FmuDescription,
    inverse_map: InverseMap,
    content_hash: str,
    kind: str,
    bus: BusPart | None = None,
) -> dict[str, bytes]:
    """Return what both kinds hold besides code and data: page, pictures, terminals, reference run."""
    run = reference_run(inverse_map)
    sections = estimator_sections(inverse_map, content_hash, run)
    if bus is not None:
        sections = [("On the bus", bus.lines), *sections[1:]]
    pages = documentation_files(description, sections, kind)
    contents = {
        "kind": kind,
        "strainfmu_version": __version__,
        "map": content_hash,
        **estimator_contents(inverse_map),
    }
    common = {
        CONTENTS: json.dumps(contents, indent=1).encode(),
        **{f"documentation/{name}": content for name, content in pages.items()},
        **terminal_files(description, _terminals(inverse_map), "estimator"),
    }
    if bus is not None:
        return {**common, **bus.files(description.guid)}
    return {
        **common,
        **layered_standard_files(run, description.interface),
        TRUTH: signal_table(run.time, run.truth, estimator_interface(inverse_map), digits=6),
    }


def export_plant(flight_model_path: Path, trajectory_path: Path, fmu_path: Path) -> None:
    """Write the plant FMU of a flight model (HDF5) on a trajectory (CSV) to ``fmu_path``.

    Raises
    ------
    InputError
        A file is missing, damaged or wrong, or the trajectory leaves the flight model's envelope.
    StrainfmuError
        PythonFMU is not installed, or the FMU could not be written; ``fmu_path`` keeps its old content.
    """
    check_fmu_path(fmu_path)
    model = load_flight_model(flight_model_path)
    trajectory = load_trajectory(trajectory_path)
    check_envelope(
        mach_knots=model.mach_knots,
        incidence_knots=model.incidence_knots,
        trajectory=trajectory,
        path=trajectory_path,
    )
    content_hash = content_hash_of(flight_model_path, flight_model.SCHEMA, flight_model.SCHEMA_VERSION)
    table = trajectory_path.read_bytes()
    code = slave_code("plant_slave", _PLANT_SOURCES)
    description = FmuDescription(
        model_name="StrainedVehicle",
        description=f"A vehicle on its trajectory, with {model.n_gauges} noisy strain gauges: {model.vehicle}",
        interface=plant_interface(model),
        content_hash=hashlib.sha256(f"{content_hash}{code.digest}".encode() + table).hexdigest(),
        stop_time=trajectory.stop_time,
        step_size=_STEP_SIZE,
        capabilities=python_package.CAPABILITIES,
        build_date=built_time_of(flight_model_path, flight_model.SCHEMA, flight_model.SCHEMA_VERSION),
    )
    reference = python_plant_reference(model, trajectory)
    interface = description.interface
    sections = [*plant_sections(model, trajectory, content_hash), *reference_sections(reference, interface)]
    pages = documentation_files(description, sections, "python")
    contents = {
        "kind": "python",
        "strainfmu_version": __version__,
        "flight_model": content_hash,
        "vehicle": model.vehicle,
        "gauges": list(model.gauge_names),
        **reference.contents,
    }
    payload = {"flight_model.h5": flight_model_path.read_bytes(), "trajectory.csv": table}
    entries = {
        **python_entries(description, code, payload),
        CONTENTS: json.dumps(contents, indent=1).encode(),
        **{f"documentation/{name}": content for name, content in pages.items()},
        **terminal_files(description, {"gauges": ((STRAIN,), "Strain of every gauge")}, "plant"),
        **reference.files(description.interface),
    }
    write_archive(fmu_path, entries)
