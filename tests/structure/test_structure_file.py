"""structure.h5: whole, of equal bytes for equal content, and refused when its parts do not fit."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from builder.structure.structure_file import (
    SCHEMA,
    SCHEMA_VERSION,
    Structure,
    load_structure,
    save_structure,
    structure_to_reuse,
)
from strainfmu.errors import InputError
from strainfmu.files import open_hdf5, write_hdf5_atomically

pytestmark = pytest.mark.fast

TETRAHEDRON = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def a_structure() -> Structure:
    """Three gauges in two layouts on a tetrahedron."""
    random = np.random.default_rng(3)
    return Structure(
        vehicle="body",
        model="swept_hexahedra",
        settings={"mesh": {"resolution": "coarse"}, "made_from": {"mesh": "a", "gauges": "b"}},
        statistics={"degrees_of_freedom": 12, "solver": "cyclic"},
        gauge_names=("one", "two", "one"),
        layout=("first", "first", "second"),
        gauge_position=random.standard_normal((3, 3)),
        gauge_direction=np.eye(3),
        gauge_length=np.array([0.0, 3e-3, 0.0]),
        gauge_surface=("internal", "external", "internal"),
        point=TETRAHEDRON,
        triangle=np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
        normal=np.tile([0.0, 0.0, 1.0], (4, 1)),
        strain_operator=1e-12 * random.standard_normal((3, 4)),
        mesh_error=np.array([1e-14, 0.0, 2e-14]),
    )


def test_comes_back_as_it_was(tmp_path: Path) -> None:
    written = a_structure()
    save_structure(written, tmp_path / "structure.h5")
    read = load_structure(tmp_path / "structure.h5")
    for entry in fields(Structure):
        np.testing.assert_array_equal(getattr(read, entry.name), getattr(written, entry.name))
    with open_hdf5(tmp_path / "structure.h5", SCHEMA, SCHEMA_VERSION) as file:
        assert file["strain_operator"].attrs["unit"] == file["mesh_error"].attrs["unit"] == "1/Pa"
        assert file["point"].attrs["unit"] == "m"


def test_equal_content_gives_one_hash(tmp_path: Path) -> None:
    one = save_structure(a_structure(), tmp_path / "one.h5")
    assert save_structure(a_structure(), tmp_path / "two.h5") == one
    other = replace(a_structure(), mesh_error=np.zeros(3))
    assert save_structure(other, tmp_path / "three.h5") != one


def test_gauges_by_layout() -> None:
    structure = a_structure()
    assert structure.layouts == ("first", "second")
    assert structure.gauges_of("first").tolist() == [0, 1]
    assert structure.gauges_of("second").tolist() == [2]
    with pytest.raises(InputError, match=r"no gauges of layout 'third', found first, second"):
        structure.gauges_of("third")


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("gauge_position", np.zeros((2, 3)), r"gauge_position: shape \(2, 3\) found, must be \(3, 3\)"),
        ("gauge_length", np.zeros((3, 1)), r"gauge_length: shape \(3, 1\) found, must be \(3,\)"),
        ("strain_operator", np.zeros((3, 5)), r"strain_operator: shape \(3, 5\) found, must be \(3, 4\)"),
        ("strain_operator", np.full((3, 4), np.nan), "strain_operator: not all values are finite"),
        ("mesh_error", np.array([0.0, np.inf, 0.0]), "mesh_error: not all values are finite"),
        ("layout", ("first", "first"), "layout: 2 found, must be 3"),
        ("layout", ("first",) * 3, "gauge_names: none, or one twice in a layout"),
        ("gauge_surface", ("inner",) * 3, r"gauge_surface: \['inner'\] found, must be internal or external"),
        ("triangle", np.array([[0, 1, 4]]), "a triangle names node 4 of 4"),
    ],
)
def test_parts_that_do_not_fit_are_refused(name: str, value: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(a_structure(), **{name: value})  # type: ignore[arg-type]  # a field by name


def test_altered_file_is_refused_and_made_again(tmp_path: Path) -> None:
    path = tmp_path / "structure.h5"
    assert structure_to_reuse(path) is None
    save_structure(a_structure(), path)
    assert structure_to_reuse(path) is not None
    content = bytearray(path.read_bytes())
    content[-20] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match="damaged or altered"):
        load_structure(path)
    assert structure_to_reuse(path) is None


def test_artefact_of_another_kind_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "map.h5"
    write_hdf5_atomically(path, "strainfmu.inverse_map", 1, lambda file: None)
    with pytest.raises(InputError, match=r"holds 'strainfmu.inverse_map', give another name"):
        structure_to_reuse(path)
