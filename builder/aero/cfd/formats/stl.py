"""STL surfaces, ASCII and binary: separate triangles, whose equal corners become one node when read."""

import re
from pathlib import Path

import numpy as np

from builder.aero.cfd.formats.text_numbers import read_file
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError
from strainfmu.files import write_bytes_atomically

# The binary layout of the 1989 StereoLithography interface specification: 80 bytes, a count, then 50 bytes each.
_RECORD = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 80
_FACET = re.compile(
    rb"facet\s+normal\s+\S+\s+\S+\s+\S+\s+outer\s+loop\s+"
    + rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)\s+" * 3
    + rb"endloop\s+endfacet",
    re.IGNORECASE,
)


def read_stl(path: Path) -> tuple[FloatArray, IntArray]:
    """Return nodes (n, 3) in the file's length unit and triangles (m, 3); equal corners are merged.

    Raises
    ------
    InputError
        The file is missing, empty, cut short or no STL, or a coordinate is no finite number.
    """
    content = read_file(path)
    corner = _binary_corners(content)
    if corner is None:
        corner = _text_corners(path, content)
    if not len(corner):
        raise InputError(f"{path}: the STL file holds no triangle")
    if not np.isfinite(corner).all():
        facet = int(np.flatnonzero(~np.isfinite(corner).all(axis=(1, 2)))[0])
        raise InputError(f"{path}: triangle {facet + 1} has a coordinate that is not finite")
    # Adding 0 turns -0 into 0, which are one place but different bytes.
    point, inverse = np.unique(corner.reshape(-1, 3) + 0.0, axis=0, return_inverse=True)
    return point, inverse.reshape(-1, 3).astype(np.int64)


def _binary_corners(content: bytes) -> FloatArray | None:
    """Return the corners (m, 3, 3) of a binary STL, or None if the length is not the length of one.

    The length decides, not the first word: binary headers that begin with "solid" are common.
    """
    if len(content) < _HEADER + 4:
        return None
    count = int.from_bytes(content[_HEADER : _HEADER + 4], "little")
    if len(content) != _HEADER + 4 + count * _RECORD.itemsize:
        return None
    return np.frombuffer(content, _RECORD, count, _HEADER + 4)["corner"].astype(np.float64)


def _text_corners(path: Path, content: bytes) -> FloatArray:
    if b"\0" in content or not content.lstrip()[:5].lower() == b"solid":
        raise InputError(
            f"{path}: neither an ASCII STL (begins with 'solid') nor a binary one (its length does not fit its "
            "count of triangles: cut short?)"
        )
    facets = _FACET.findall(content)
    begun = len(re.findall(rb"^\s*facet\s", content, re.IGNORECASE | re.MULTILINE))
    if len(facets) != begun or b"endsolid" not in content[-400:].lower():
        raise InputError(f"{path}: {begun} facets begun, {len(facets)} complete; cut short or damaged STL")
    try:
        return np.array(facets, dtype=np.float64).reshape(-1, 3, 3)
    except ValueError as error:
        raise InputError(f"{path}: a vertex is no number: {error}") from error


def write_stl(path: Path, point: FloatArray, triangle: IntArray) -> None:
    """Write nodes (n, 3) and triangles (m, 3) as binary STL, atomically.

    Raises
    ------
    StrainfmuError
        The file could not be written.
    """
    corner = point.astype(np.float32)[triangle]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    records = np.zeros(len(triangle), _RECORD)
    records["normal"] = np.divide(normal, size, out=np.zeros_like(normal), where=size > 0.0)
    records["corner"] = corner
    header = b"strainfmu surface, body axes x aft y starboard z up, metres".ljust(_HEADER)
    write_bytes_atomically(path, header + len(triangle).to_bytes(4, "little") + records.tobytes())
