"""Series of pressure fields as VTKHDF, which ParaView opens from version 5.12 on.

Layout: the transient UnstructuredGrid of the VTKHDF file format, version 2.0 (docs.vtk.org, "VTKHDF File Format").
The surface stays: points and triangles are there once. The offsets of every step point to them, and to the step's
own point data.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.estimator.estimate import Estimate
from strainfmu.estimator.estimates.linear_field import no_field
from strainfmu.estimator.estimates.pressure_field import PressureField
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.recorded.output.guarded_file import GuardedFile
from strainfmu.recorded.output.whole_file import whole_file, writing

FIELD_SUFFIX = ".vtkhdf"
_TRIANGLE = 5
"""VTK_TRIANGLE."""

ARRAYS = ("pressure", "sigma_pressure")
NET_ARRAYS = ("net_pressure", "sigma_net_pressure")
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
        if not inverse_map.has_field:
            raise no_field()
        self.path, self.every, self.steps, self._n = path, every, 0, len(inverse_map.point)
        self._passed = 0
        self._net = inverse_map.field_is_net and inverse_map.manifold is None
        self._guarded = GuardedFile(temporary)
        self._file = h5py.File(self._guarded, "w")
        self._root = self._file.create_group("VTKHDF", track_order=True)
        self._root.attrs["Version"] = np.array([2, 0], dtype="i8")
        kind = b"UnstructuredGrid"
        self._root.attrs.create("Type", kind, dtype=h5py.string_dtype("ascii", len(kind)))
        self._write_surface(inverse_map.point, inverse_map.triangle)
        self._prepare_steps()

    def _write_surface(self, point: np.ndarray, triangle: np.ndarray) -> None:
        n_t = len(triangle)
        counts = {"NumberOfPoints": len(point), "NumberOfCells": n_t, "NumberOfConnectivityIds": 3 * n_t}
        for name, value in counts.items():
            self._root.create_dataset(name, data=np.array([value], dtype="i8"))
        self._root.create_dataset("Points", data=point.astype("f4")).attrs["unit"] = "m"
        self._root.create_dataset("Connectivity", data=triangle.ravel().astype("i8"))
        self._root.create_dataset("Offsets", data=3 * np.arange(n_t + 1, dtype="i8"))
        self._root.create_dataset("Types", data=np.full(n_t, _TRIANGLE, dtype="u1"))

    def _prepare_steps(self) -> None:
        data, steps = self._root.create_group("PointData"), self._root.create_group("Steps")
        self._steps = steps
        names = NET_ARRAYS if self._net else ARRAYS
        self._arrays = [
            data.create_dataset(
                name, (0,), maxshape=(None,), dtype="f4", chunks=(self._n,), compression="gzip", shuffle=True
            )
            for name in names
        ]
        for item in self._arrays:
            item.attrs["unit"] = "Pa"
        self._times = steps.create_dataset("Values", (0,), maxshape=(None,), dtype="f8", chunks=(1024,))
        self._times.attrs["unit"] = "s"
        steps.attrs["NSteps"] = 0

    def write(self, time: float, field: PressureField) -> None:
        """Append ``field`` at ``time`` [s].

        Raises
        ------
        StrainfmuError
            The file cannot be written.
        """
        with writing(self.path):
            first = self.steps * self._n
            for item, values in zip(self._arrays, (field.pressure, field.std), strict=True):
                item.resize((first + self._n,))
                item[first:] = values.astype("f4")
            self._times.resize((self.steps + 1,))
            self._times[self.steps] = time
            self.steps += 1
            self._guarded.raise_error()

    def write_block(self, time: FloatArray, estimates: Estimate) -> None:
        """Append the fields of every ``every``-th sample, ``time`` (n,) [s] and n ``estimates`` of a block."""
        for row in range((-self._passed) % self.every, len(time), self.every):
            self.write(float(time[row]), estimates[row].pressure())
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
    InputError
        The map holds no pressure field.
    StrainfmuError
        It cannot be written; an earlier file remains unchanged.
    """
    with whole_file(path, lambda temporary: FieldSeriesWriter(path, temporary, inverse_map, every)) as writer:
        yield writer
