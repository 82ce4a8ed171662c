"""Studies as groups of one HDF5 file, kept for later runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import h5py

from strainfmu.errors import InputError
from strainfmu.files import open_hdf5, write_hdf5_atomically
from strainfmu.records import read_record, write_record

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
