"""Pressure fields as a series in a VTKHDF file, for ParaView from version 5.12 on.

Layout: the transient UnstructuredGrid of the VTKHDF file format, version 2.0 (docs.vtk.org, "VTKHDF File Format").
The surface stays: points and triangles are there once. The offsets of every step point to them, and to the step's
own point data.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.estimator.off_deadline import no_field
from strainfmu.files import GuardedFile, whole_file, writing

FIELD_SUFFIX = ".vtkhdf"
_TRIANGLE = 5
"""VTK_TRIANGLE."""

FIELD_ARRAYS = ("pressure", "sigma_pressure")
NET_FIELD_ARRAYS = ("net_pressure", "sigma_net_pressure")
"""Arrays of points [Pa]: absolute pressure, or p - p_inf, with its standard deviation."""


def check_field_output(path: Path, inverse_map: InverseMap | None, source: Path) -> None:
    """Refuse a series that cannot be written before any work begins.

    Raises
    ------
    InputError
        The suffix is another one, ``source`` is no map, or the map holds no pressure field.
    """
    if path.suffix.lower() != FIELD_SUFFIX:
        raise InputError(f"{path}: expected {FIELD_SUFFIX}, got '{path.suffix}'")
    if inverse_map is None:
        raise InputError(f"{source}: --field: expected an inverse map, got an FMU")
    manifold = inverse_map.manifold
    if not inverse_map.has_field or (manifold is not None and manifold.surface_field is None):
        raise InputError(f"{source}: --field: {no_field()}")


class FieldSeriesWriter:
    """Writes one field after another into a file in the VTKHDF layout.

    ``path`` is the file that messages name, ``every`` the samples from one field to the next, ``steps`` the number
    of fields written.
    """

    def __init__(self, path: Path, temporary: Path, inverse_map: InverseMap, every: int) -> None:
        self.path, self.every, self.steps, self._passed = path, every, 0, 0
        point, triangle = inverse_map.point, inverse_map.triangle
        self._n, n_t = len(point), len(triangle)
        self._guarded = GuardedFile(temporary)
        self._file = h5py.File(self._guarded, "w")
        root = self._file.create_group("VTKHDF", track_order=True)
        root.attrs["Version"] = np.array([2, 0], dtype="i8")
        kind = b"UnstructuredGrid"
        root.attrs.create("Type", kind, dtype=h5py.string_dtype("ascii", len(kind)))
        counts = {"NumberOfPoints": self._n, "NumberOfCells": n_t, "NumberOfConnectivityIds": 3 * n_t}
        for name, value in counts.items():
            root.create_dataset(name, data=np.array([value], dtype="i8"))
        root.create_dataset("Points", data=point.astype("f4")).attrs["unit"] = "m"
        root.create_dataset("Connectivity", data=triangle.ravel().astype("i8"))
        root.create_dataset("Offsets", data=3 * np.arange(n_t + 1, dtype="i8"))
        root.create_dataset("Types", data=np.full(n_t, _TRIANGLE, dtype="u1"))
        data, self._steps = root.create_group("PointData"), root.create_group("Steps")
        layout: dict[str, Any] = {"shape": (0,), "maxshape": (None,), "dtype": "f4", "chunks": (self._n,)}
        is_net = inverse_map.field_is_net and inverse_map.manifold is None
        self._arrays = [
            data.create_dataset(name, **layout, compression="gzip", shuffle=True)
            for name in (NET_FIELD_ARRAYS if is_net else FIELD_ARRAYS)
        ]
        for item in self._arrays:
            item.attrs["unit"] = "Pa"
        self._times = self._steps.create_dataset("Values", (0,), maxshape=(None,), dtype="f8", chunks=(1024,))
        self._times.attrs["unit"] = "s"
        self._steps.attrs["NSteps"] = 0

    def write(self, time: FloatArray, estimates: Estimate) -> None:
        """Append the fields of every ``every``-th sample, ``time`` (n,) [s] and n ``estimates`` of a block.

        Raises
        ------
        StrainfmuError
            The file cannot be written.
        """
        for row in range((-self._passed) % self.every, len(time), self.every):
            field, first = estimates[row].pressure(), self.steps * self._n
            with writing(self.path):
                for item, values in zip(self._arrays, (field.pressure, field.std), strict=True):
                    item.resize((first + self._n,))
                    item[first:] = values.astype("f4")
                self._times.resize((self.steps + 1,))
                self._times[self.steps] = time[row]
                self._guarded.raise_error()
            self.steps += 1
        self._passed += len(time)

    def finish(self) -> None:
        """Write where each step finds its data and bring all to the disk; raises OSError if it cannot."""
        n, steps = self.steps, self._steps
        steps.attrs["NSteps"] = n
        steps.create_dataset("NumberOfParts", data=np.ones(n, dtype="i8"))
        for name in ("PartOffsets", "PointOffsets"):
            steps.create_dataset(name, data=np.zeros(n, dtype="i8"))
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            steps.create_dataset(name, data=np.zeros((n, 1), dtype="i8"))
        offsets = steps.create_group("PointDataOffsets")
        for item in self._arrays:
            offsets.create_dataset(str(item.name).rsplit("/", 1)[-1], data=self._n * np.arange(n, dtype="i8"))
        self._file.close()
        self._guarded.sync()

    def close(self) -> None:
        """Close the file, in order or not."""
        self._file.close()
        self._guarded.close()


@contextmanager
def field_series_writer(path: Path, inverse_map: InverseMap, every: int = 1) -> Iterator[FieldSeriesWriter]:
    """Open a series on the surface of ``inverse_map``; it is renamed into place at the end, removed on an error.

    Raises
    ------
    StrainfmuError
        It cannot be written; an earlier file remains unchanged.
    """
    with whole_file(path, lambda temporary: FieldSeriesWriter(path, temporary, inverse_map, every)) as writer:
        yield writer
