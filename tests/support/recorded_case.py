"""Recorded data of the synthetic vehicle, as files and as arrays."""

import csv
from pathlib import Path

import h5py
import numpy as np
from bus_run import flight
from synthetic_vehicle import N_GAUGES

NAMES = [f"G{i}" for i in range(N_GAUGES)]


def samples(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time (n,) [s], strains (n, n_d) [m/m] and q_inf (n,) [Pa]."""
    flown = flight(n)
    strain = np.array([sample.strain for sample in flown])
    return 1e-3 * np.arange(n), strain, np.array([sample.dynamic_pressure for sample in flown])


def write_csv(path: Path, headings: list[str], *columns: np.ndarray) -> Path:
    """Write ``columns`` under ``headings`` and return the path."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(headings)
        writer.writerows(np.column_stack(columns).tolist())
    return path


def write_flight(path: Path, n: int = 20, unit: str | None = None, **columns: np.ndarray | float) -> Path:
    """Write a flight as CSV, strains as they are under the heading ``[unit]``, and further columns."""
    time, strain, pressure = samples(n)
    bracket = "" if unit is None else f" [{unit}]"
    headings = ["time", *(f"{name}{bracket}" for name in NAMES), "dynamic_pressure", *columns]
    more = [np.broadcast_to(values, time.shape) for values in columns.values()]
    return write_csv(path, headings, time, strain, pressure, *more)


def read_csv(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of numbers under their headings with the unit."""
    rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if "[" in name}


def suspect_names(path: Path) -> list[str]:
    """Return the column of suspects of a CSV or HDF5 file of estimates."""
    if path.suffix == ".csv":
        return [row["suspect_gauges"] for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines())]
    with h5py.File(path) as file:
        return [name.decode() for name in file["suspect_gauges"][()]]
