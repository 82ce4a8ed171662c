"""Synthetic inputs made by numpy: numbers of a plausible size, no vehicle and no physics behind them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from strainfmu.cosim.models.flight_model import FlightModel, save_flight_model
from strainfmu.estimator.map.inverse_map import InverseMap, save_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator, export_plant

N_GAUGES = 6
TRAJECTORY = """time_s,mach_number,angle_of_attack_deg,sideslip_angle_deg,altitude_km
0,5.0,0,0,20
0.1,5.5,4,2,20.5
0.2,6.5,6,-1,21
0.4,6.5,2,0,22
"""


def synthetic_inverse_map(seed: int = 1, n_gauges: int = N_GAUGES) -> InverseMap:
    """Return a map of Case 1 with 3 pressure states: random, but for what follows from it."""
    random = np.random.default_rng(seed)
    angle = np.linspace(0.0, 2.0 * np.pi, n_gauges, endpoint=False)
    root = random.normal(size=(5, 5))
    noise = np.full(n_gauges, 1e-7)
    state_operator = 1e-9 * random.normal(size=(n_gauges, 3))
    mean_strain = random.normal(size=n_gauges) * 1e-6
    load_per_state = random.normal(size=(5, 3))
    return InverseMap(
        vehicle=f"synthetic vehicle {seed} <&>",
        case=1,
        gauge_names=tuple(f"G{i}" for i in range(n_gauges)),
        gauge_position=np.column_stack(
            (np.linspace(0.3, 3.3, n_gauges), 0.1 * np.sin(angle), 0.1 * np.cos(angle))
        ),
        gauge_direction=np.tile([1.0, 0.0, 0.0], (n_gauges, 1)),
        noise_std=noise,
        state_operator=state_operator,
        gauge_covariance=np.diag(noise**2),
        error_strain=np.zeros((n_gauges, 5)),
        error_load=root,
        regularisation=0.0,
        load_per_state=load_per_state,
        load_of_mean=random.normal(size=5) * 1e3,
        mean_strain=mean_strain,
        strain_range=np.append(np.full(n_gauges - 1, 1e-4), 0.0),
        coefficient_range=np.array([[0.1, 0.2], [-1.0, 1.0], [-1.0, 1.0], [-0.5, 0.5], [0.0, 0.0]]),
        reference_area=0.2,
        reference_length=0.5,
        nominal_dynamic_pressure=95.8e3,
    )


def synthetic_flight_model(seed: int = 1, n_gauges: int = N_GAUGES, n_harmonic: int = 4) -> FlightModel:
    """Return a random model with 2 channels, Mach number 5 to 7 and total incidence 0 to 12 deg."""
    random = np.random.default_rng(seed)
    return FlightModel(
        vehicle=f"synthetic vehicle {seed}",
        gauge_names=tuple(f"G{i}" for i in range(n_gauges)),
        gauge_roll_angle=np.linspace(0.0, 2.0 * np.pi, n_gauges, endpoint=False),
        gauge_channel=np.arange(n_gauges) % 2,
        mach_knots=np.array([5.0, 5.5, 6.0, 7.0]),
        incidence_knots=np.radians([0.0, 3.0, 12.0]),
        strain_table=random.normal(size=(3, 2, 4, 4, 2, n_harmonic, 2)) * 1e-9,
        coefficient_table=random.normal(size=(3, 2, 4, 4, 3)),
        strain_of_internal_pressure=random.normal(size=n_gauges) * 1e-9,
        internal_pressure=None,
        base_area=0.1,
        reference_area=0.2,
        reference_length=0.5,
        noise_std=1e-6,
        provenance={"made": "by numpy"},
    )


def write_trajectory(path: Path, text: str = TRAJECTORY) -> Path:
    """Write a trajectory file and return its path."""
    path.write_text(text)
    return path


@dataclass(frozen=True)
class SyntheticFiles:
    """Paths of synthetic files; estimator and map 2 differ from 1 in every number."""

    map_1: Path
    map_2: Path
    flight_model: Path
    trajectory: Path
    estimator_1: Path
    estimator_2: Path
    plant: Path


def synthetic_files(folder: Path) -> SyntheticFiles:
    """Return where in ``folder`` the synthetic files lie."""
    return SyntheticFiles(
        map_1=folder / "map_1.h5",
        map_2=folder / "map_2.h5",
        flight_model=folder / "flight_model.h5",
        trajectory=folder / "trajectory.csv",
        estimator_1=folder / "estimator_1.fmu",
        estimator_2=folder / "estimator_2.fmu",
        plant=folder / "plant.fmu",
    )


def make_synthetic_files(folder: Path) -> SyntheticFiles:
    """Write all synthetic files into ``folder``."""
    files = synthetic_files(folder)
    write_trajectory(files.trajectory)
    save_inverse_map(synthetic_inverse_map(1), files.map_1)
    save_inverse_map(synthetic_inverse_map(2), files.map_2)
    save_flight_model(synthetic_flight_model(), files.flight_model)
    export_estimator(files.map_1, files.estimator_1, ExportOptions(inputs="full", zero_inputs=True))
    export_estimator(files.map_2, files.estimator_2, ExportOptions(inputs="full", zero_inputs=True))
    export_plant(files.flight_model, files.trajectory, files.plant)
    return files
