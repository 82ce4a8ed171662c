"""Export of the two FMUs: the estimator of a map, and the plant of a flight model and a trajectory."""

from __future__ import annotations

import hashlib
from pathlib import Path

from strainfmu.cosim import flight_model
from strainfmu.cosim.flight_model import check_envelope, load_flight_model
from strainfmu.cosim.trajectory import load_trajectory
from strainfmu.files import content_hash_of
from strainfmu.fmu.documentation import documentation_files, estimator_sections, plant_sections
from strainfmu.fmu.model_description import FmuDescription
from strainfmu.fmu.package import CAPABILITIES, check_fmu_path, slave_code, write_fmu
from strainfmu.interface import estimator_interface, plant_interface
from strainfmu.inverse_map import SCHEMA, SCHEMA_VERSION, load_inverse_map

# Run-time modules that each slave imports, itself or through others.
_ESTIMATOR_MODULES = (
    "__init__.py",
    "errors.py",
    "estimator.py",
    "files.py",
    "health.py",
    "innovation.py",
    "interface.py",
    "inverse_map.py",
    "isolation.py",
    "load_errors.py",
    "masked_map.py",
    "masks.py",
    "records.py",
)
_PLANT_MODULES = (
    "__init__.py",
    "atmosphere.py",
    "cosim/__init__.py",
    "cosim/flight_model.py",
    "cosim/trajectory.py",
    "errors.py",
    "files.py",
    "flight_condition.py",
    "health.py",
    "interface.py",
    "records.py",
)

_STEP_SIZE = 1e-2


def export_estimator(map_path: Path, fmu_path: Path, model_name: str = "StrainLoadEstimator") -> None:
    """Write the estimator FMU of the map at ``map_path`` to ``fmu_path``.

    Raises
    ------
    InputError
        The map is missing or damaged, or a name cannot be used.
    StrainfmuError
        PythonFMU is not installed, or the FMU could not be written; ``fmu_path`` keeps its old content.
    """
    check_fmu_path(fmu_path)
    inverse_map = load_inverse_map(map_path)
    content_hash = content_hash_of(map_path, SCHEMA, SCHEMA_VERSION)
    code = slave_code("estimator_slave", _ESTIMATOR_MODULES)
    description = FmuDescription(
        model_name,
        f"Aerodynamic loads from the strain of {inverse_map.n_gauges} gauges: {inverse_map.vehicle}",
        estimator_interface(inverse_map),
        hashlib.sha256(f"{content_hash}{code.digest}".encode()).hexdigest(),
        stop_time=1.0,
        step_size=_STEP_SIZE,
        capabilities=CAPABILITIES,
    )
    documentation = documentation_files(description, estimator_sections(inverse_map, content_hash))
    write_fmu(fmu_path, description, code, {"map.h5": map_path.read_bytes()}, documentation)


def export_plant(
    flight_model_path: Path, trajectory_path: Path, fmu_path: Path, model_name: str = "StrainedVehicle"
) -> None:
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
    check_envelope(model.mach_knots, model.incidence_knots, trajectory, trajectory_path)
    content_hash = content_hash_of(flight_model_path, flight_model.SCHEMA, flight_model.SCHEMA_VERSION)
    table = trajectory_path.read_bytes()
    code = slave_code("plant_slave", _PLANT_MODULES)
    description = FmuDescription(
        model_name,
        f"A vehicle on its trajectory, with {model.n_gauges} noisy strain gauges: {model.vehicle}",
        plant_interface(model),
        hashlib.sha256(f"{content_hash}{code.digest}".encode() + table).hexdigest(),
        stop_time=trajectory.stop_time,
        step_size=_STEP_SIZE,
        capabilities=CAPABILITIES,
    )
    documentation = documentation_files(description, plant_sections(model, trajectory, content_hash))
    payload = {"flight_model.h5": flight_model_path.read_bytes(), "trajectory.csv": table}
    write_fmu(fmu_path, description, code, payload, documentation)
