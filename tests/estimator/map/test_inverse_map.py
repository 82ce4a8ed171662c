"""The artefact: what goes in comes out, and nothing damaged does."""

from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from flight_maps import whole_map
from inertia_maps import with_masses
from random_map import N_GAUGES, N_STATES, map_of, nothing_of, random_map, random_model
from state_estimates import state_gain, state_offset
from synthetic_vehicle import synthetic_inverse_map

from strainfmu import files
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.map.inverse_map import (
    SCHEMA,
    SCHEMA_VERSION,
    InverseMap,
    left_out,
    load_inverse_map,
    save_inverse_map,
)
from strainfmu.estimator.map.sensors import strain_rows
from strainfmu.estimator.reference.gain import load_covariance, load_gain, residual_precision
from strainfmu.files import content_hash_of
from strainfmu.linear.state_map import check_covariance

pytestmark = pytest.mark.fast


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    save_inverse_map(random_map(), tmp_path / "map.h5")
    return tmp_path / "map.h5"


def with_field(inverse_map: InverseMap) -> InverseMap:
    """``inverse_map`` with a pressure field on two triangles."""
    random = np.random.default_rng(3)
    return replace(
        inverse_map,
        field_mean=random.normal(size=4).astype(np.float32),
        field_modes=random.normal(size=(4, inverse_map.n_states)).astype(np.float32),
        point=random.normal(size=(4, 3)).astype(np.float32),
        triangle=np.array([[0, 1, 2], [2, 1, 3]], dtype=np.int32),
    )


def without_columns(inverse_map: InverseMap) -> InverseMap:
    return replace(inverse_map, error_strain=np.zeros((N_GAUGES, 0)), error_load=np.zeros((5, 0)))


def case_2_map() -> InverseMap:
    return map_of(random_model(gamma=1.0, n_gauges=N_GAUGES, n_states=2 * N_GAUGES))


@pytest.mark.parametrize(
    "inverse_map",
    [random_map(), case_2_map(), with_field(random_map()), without_columns(random_map())],
    ids=["case 1", "case 2", "with field", "without columns of errors"],
)
def test_round_trip(inverse_map: InverseMap, tmp_path: Path) -> None:
    digest = save_inverse_map(inverse_map, tmp_path / "deep" / "map.h5")
    loaded = load_inverse_map(tmp_path / "deep" / "map.h5")
    for entry in fields(InverseMap):
        found, wanted = getattr(loaded, entry.name), getattr(inverse_map, entry.name)
        if isinstance(wanted, np.ndarray):
            np.testing.assert_array_equal(found, wanted)
            assert found.dtype == wanted.dtype
        elif is_dataclass(wanted):
            assert vars(found).keys() == vars(wanted).keys()
            for name, value in vars(wanted).items():
                np.testing.assert_array_equal(getattr(found, name), value)
        else:
            assert found == wanted
    assert loaded.n_gauges == N_GAUGES
    assert content_hash_of(tmp_path / "deep" / "map.h5", SCHEMA, SCHEMA_VERSION) == digest


def test_a_check_makes_no_covariance_of_all_gauges_for_its_diagonal() -> None:
    assert "noise_covariance" not in vars(random_map())


def test_every_number_has_its_unit(saved: Path) -> None:
    with h5py.File(saved) as file:
        units = {name: file[name].attrs["unit"] for name in file if name != "gauge_names"}
    assert len(units) == 22
    assert units["state_operator"] == "(m/m)/Pa"
    assert units["gauge_covariance"] == "(m/m)^2"
    assert units["nominal_dynamic_pressure"] == "Pa"


def test_states_of_a_prior_have_no_unit(tmp_path: Path) -> None:
    save_inverse_map(with_field(case_2_map()), tmp_path / "map.h5")
    with h5py.File(tmp_path / "map.h5") as file:
        assert file["state_operator"].attrs["unit"] == "(m/m)/1"
        assert file["field_modes"].attrs["unit"] == "Pa/1"


def test_content_hash_is_of_content_alone(tmp_path: Path) -> None:
    first = save_inverse_map(random_map(), tmp_path / "one.h5")
    assert save_inverse_map(random_map(), tmp_path / "two.h5") == first
    assert save_inverse_map(replace(random_map(), reference_area=0.2000001), tmp_path / "three.h5") != first
    assert save_inverse_map(replace(random_map(), vehicle="other"), tmp_path / "four.h5") != first


def test_flipped_bit_anywhere_is_refused_or_harmless(saved: Path) -> None:
    """One bit of every 37th byte: only the padding behind the first line of text may be other than it was."""
    content = saved.read_bytes()
    padding = range(content.index(b"\n") + 1, files.USER_BLOCK_SIZE)
    for position in range(0, len(content), 37):
        damaged = bytearray(content)
        damaged[position] ^= 1 << position % 8
        saved.write_bytes(bytes(damaged))
        if position in padding:
            np.testing.assert_array_equal(state_gain(load_inverse_map(saved)), state_gain(random_map()))
        else:
            with pytest.raises(InputError, match=r"map.h5: (damaged|expected a file|schema version)"):
                load_inverse_map(saved)


def test_flipped_bit_in_any_array_is_refused(saved: Path) -> None:
    """The lowest bit of one number of each array, in the file's bytes."""
    with h5py.File(saved) as file:
        # h5py counts from behind the user block where the file has one.
        places = {name: (file[name].id.get_offset(), file[name].id.get_storage_size()) for name in file}
    where = {name: place for name, place in places.items() if place[1]}  # no section station has no bytes
    assert len(where) == 22
    content = saved.read_bytes()
    for offset, size in where.values():
        damaged = bytearray(content)
        damaged[offset + (size // 2) // 8 * 8] ^= 1
        saved.write_bytes(bytes(damaged))
        with pytest.raises(InputError, match="damaged or altered"):
            load_inverse_map(saved)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_truncated_file_is_refused(share: float, saved: Path) -> None:
    content = saved.read_bytes()
    saved.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match=r"map.h5: damaged"):
        load_inverse_map(saved)


@pytest.mark.parametrize("version", [9, 11])
def test_other_schema_version_is_refused(version: int, tmp_path: Path) -> None:
    files.write_hdf5_atomically(tmp_path / "map.h5", SCHEMA, version, lambda file: None)
    with pytest.raises(InputError, match=f"expected schema version 10, got {version}; build it again"):
        load_inverse_map(tmp_path / "map.h5")


def test_other_kind_of_file_is_refused(tmp_path: Path) -> None:
    files.write_hdf5_atomically(tmp_path / "map.h5", "strainfmu.snapshots", 1, lambda file: None)
    with pytest.raises(InputError, match=r"schema 'strainfmu.inverse_map', found 'strainfmu.snapshots'"):
        load_inverse_map(tmp_path / "map.h5")


def test_edited_file_is_refused(saved: Path) -> None:
    with h5py.File(saved, "r+") as file:
        file.attrs["vehicle"] = "another vehicle"
    with pytest.raises(InputError, match="damaged or altered"):
        load_inverse_map(saved)


def test_missing_entry_is_named(tmp_path: Path) -> None:
    def fill(file: h5py.File) -> None:
        file.attrs["vehicle"] = "a vehicle"
        file["case"] = 1

    files.write_hdf5_atomically(tmp_path / "map.h5", SCHEMA, SCHEMA_VERSION, fill)
    with pytest.raises(InputError, match=r"damaged, entry .*gauge_names.* is missing"):
        load_inverse_map(tmp_path / "map.h5")


def test_file_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load_inverse_map(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("not a map")
    with pytest.raises(InputError, match="damaged, or not an HDF5 file"):
        load_inverse_map(tmp_path / "text.h5")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"load_per_state": np.zeros((5, 4))}, r"load_per_state has shape \(5, 4\), must be \(5, 3\)"),
        ({"gauge_position": np.zeros((8, 2))}, r"gauge_position has shape \(8, 2\), must be \(8, 3\)"),
        ({"error_load": np.zeros((5, 2))}, r"error_load has shape \(5, 2\), must be \(5, 5\)"),
        ({"mean_strain": np.full(8, np.nan)}, "mean_strain holds values that are not finite"),
        ({"load_of_mean": np.full(5, np.inf)}, "load_of_mean holds values that are not finite"),
        ({"reference_area": 0.0}, "reference_area is 0, must be positive"),
        ({"reference_length": np.nan}, "reference_length is nan, must be positive"),
        ({"nominal_dynamic_pressure": np.inf}, "nominal_dynamic_pressure is inf, must be positive"),
        ({"gauge_names": ("a",) * 8}, "at least one name and none twice"),
        ({"noise_std": np.zeros(8)}, "noise_std must be positive"),
        ({"state_operator": np.zeros((8, 3))}, "state_operator does not identify the states"),
        ({"case": 3}, "case is 3, must be one of 1, 2"),
        ({"regularisation": 1.0}, "regularisation is 1.0, must be 0 in Case 1"),
        ({"case": 2}, "regularisation is 0.0, must be positive in Case 2"),
        (
            {"gauge_covariance": 0.9 * random_map().gauge_covariance},
            "gauge_covariance has variances below noise_std squared",
        ),
        ({"gauge_covariance": np.ones((8, 8))}, "covariance must be symmetric and positive definite"),
        ({"error_strain": np.zeros((7, 5))}, r"error_strain has shape \(7, 5\), must be \(8, 5\)"),
        (
            {"field_mean": np.zeros(4, np.float32)},
            "field_modes, point, triangle missing, the pressure field needs",
        ),
        ({"point": np.zeros((4, 2), np.float32)}, r"point has shape \(4, 2\), must be \(4, 3\)"),
        ({"triangle": np.array([[0, 1, 4]])}, r"triangle names nodes outside 0 .. 3"),
        (
            {"fixed_strain": np.ones(8), "fixed_load": np.zeros(0)},
            "fixed_strain of fixed_strain, fixed_load found",
        ),
        ({"mean_product": np.zeros(0)}, "gauge_error_product, common_error of .* found, must be all or none"),
        ({"gauge_error_product": np.ones((21, 8))}, "mean_product is 0, must be given where gauge_error_product"),
        ({"envelope_limit": np.ones(2)}, r"envelope_limit has shape \(2,\), must be \(0,\)"),
        ({"envelope_direction": np.ones((2, 5))}, r"envelope_limit has shape \(0,\), must be \(2,\)"),
        ({"altitude_range": np.array([0.0, np.inf])}, "altitude_range holds values that are not finite"),
        ({"mach_number_range": np.array([np.nan, 5.0])}, "mach_number_range holds values that are not finite"),
        ({"field_mean": np.zeros(0, np.float32)}, "field_mean missing, the pressure field needs"),
        ({"fixed_strain": np.ones(7)}, r"fixed_strain has shape \(7,\), must be \(8,\)"),
        ({"sensors": strain_rows(7)}, r"sensors: kind has shape \(7,\), must be \(8,\)"),
    ],
)
def test_values_that_cannot_be_meant_are_refused(changes: dict[str, object], words: str) -> None:
    whole = random_map() if np.size(changes.get("field_mean", ())) else with_field(random_map())
    with pytest.raises(InputError, match=f"inverse map: .*{words}"):
        replace(whole, **changes)


def test_data_that_a_map_does_not_have_are_neutral(saved: Path) -> None:
    """Zeros, no rows and no bounds, of the map's shapes; its file leaves them out."""
    held, names = load_inverse_map(saved), set(left_out(random_map()))
    for name, shape in {
        "field_mean": (0,),
        "field_modes": (0, N_STATES),
        "field_std": (0,),
        "point": (0, 3),
        "triangle": (0, 3),
        "fixed_strain": (N_GAUGES,),
        "fixed_load": (5,),
        "gauge_error_product": (21, N_GAUGES),
        "common_error": (0, 6, N_GAUGES),
        "mean_product": (21,),
        "envelope_direction": (0, 5),
        "envelope_limit": (0,),
    }.items():
        assert name in names
        assert getattr(held, name).shape == shape
        assert not getattr(held, name).any()
    for name in ("dynamic_pressure_range", "mach_number_range", "altitude_range"):
        assert name in names
        assert getattr(held, name).tolist() == [-np.inf, np.inf]
    assert names >= {"sensors", "thermal", "field_is_net"}
    assert not any((held.has_field, held.has_auxiliary_sensors, held.has_temperature, held.errors_follow_strain))
    np.testing.assert_array_equal(held.thermal.isothermal_covariance, held.gauge_covariance)
    with h5py.File(saved) as file:
        assert not names & {*file, *file.attrs}


def test_neutral_data_follow_the_rest_of_the_map() -> None:
    """Other errors of gauges are those without temperature modes; a map goes without what it had."""
    held = random_map()
    noisy = replace(held, gauge_covariance=2.0 * held.gauge_covariance)
    np.testing.assert_array_equal(noisy.thermal.isothermal_covariance, noisy.gauge_covariance)
    bare = nothing_of("field_mean", "field_modes", "point", "triangle", "field_std")
    assert left_out(replace(with_field(held), **bare)) == left_out(held)


def test_as_many_states_as_gauges_are_refused() -> None:
    """Least squares needs a gauge more than states; a prior does not."""
    with pytest.raises(InputError, match="8 gauges for 8 states found, health needs at least one gauge more"):
        map_of(random_model(gamma=0.0, n_gauges=8, n_states=8))
    assert map_of(random_model(gamma=1.0, n_gauges=8, n_states=8)).residual_degrees_of_freedom == 8


@pytest.mark.parametrize(
    "covariance", [np.diag([1.0, -1.0]), np.zeros((2, 2)), np.ones((2, 2)), np.array([[1.0, 0.5], [0.0, 1.0]])]
)
def test_covariance_that_is_none_is_refused(covariance: np.ndarray) -> None:
    with pytest.raises(InputError, match="noise_covariance must be symmetric and positive definite"):
        check_covariance(covariance)


def test_states_that_gauges_read_alike_are_refused() -> None:
    """A sum of two columns is no third state, but for round-off."""
    model = random_model(gamma=0.0)
    model.a[:, 2] = 3.0 * model.a[:, 0] - 1e3 * model.a[:, 1]
    with pytest.raises(InputError, match="state_operator does not identify the states"):
        map_of(model)


def test_state_that_no_gauge_sees_is_taken_under_a_prior() -> None:
    """Its gain is 0 but for round-off; nothing is divided by it."""
    model = random_model(gamma=1.0, n_gauges=N_GAUGES, n_states=N_STATES)
    model.a[:, 1] = 0.0
    gain = state_gain(map_of(model))
    assert np.abs(gain[1]).max() < 1e-13 * np.abs(gain).max()
    assert np.all(np.abs(gain[[0, 2]]).max(axis=1) > 0.0)


@pytest.mark.parametrize("gamma", [0.0, 1.0, 10.0])
def test_what_follows_is_that_of_the_model(gamma: float) -> None:
    """Gamma, X, T, k, W and covariance of loads by the book, to 1e-9; chi-square of a prior has gamma 1."""
    model = random_model(gamma=gamma)
    found = map_of(model)
    precision = residual_precision(found)
    std = np.outer(found.noise_std, found.noise_std)
    for ours, theirs in (
        (found.noise_covariance, model.noise_covariance),
        (found.strain_load_covariance, model.strain_load_covariance),
        (state_gain(found), model.gain()),
        (state_offset(found), -model.gain() @ model.m),
        (load_gain(found), model.load_gain()),
        (load_covariance(found), model.load_covariance()),
        (precision * std, model.precision() * std),
    ):
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9 * np.abs(theirs).max())
    n_gauges, n_states = model.a.shape
    assert found.residual_degrees_of_freedom == (n_gauges if gamma > 0.0 else n_gauges - n_states)


def test_file_is_whole_or_as_it_was(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Writing fails: the old map stays, no temporary file is left, the error names the path."""
    before = saved.read_bytes()

    def no_space(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", no_space)
    with pytest.raises(StrainfmuError, match=r"map.h5: could not be written: No space left on device"):
        save_inverse_map(random_map(2), saved)
    assert saved.read_bytes() == before
    assert [path.name for path in saved.parent.iterdir()] == ["map.h5"]


def test_a_map_in_text_is_short() -> None:
    """Arrays stand with their shape: a screen of a terminal shows the whole."""
    for held in (random_map(), with_masses(whole_map())):
        shown = repr(held)
        assert len(shown.splitlines()) <= 40
        assert f"state_operator {held.state_operator.shape}" in " ".join(shown.split())
        assert len(repr(held.sensors).splitlines()) <= 5


def test_files_grow_with_the_gauges_not_with_their_square(tmp_path: Path) -> None:
    """Own errors are one number a gauge, and a covariance of mostly zeros is packed: 512 gauges take twice 256."""
    size = {}
    for n in (256, 512):
        held = replace(synthetic_inverse_map(n_gauges=n), own_error_strain=np.linspace(1e-7, 2e-7, n))
        save_inverse_map(held, tmp_path / "map.h5")
        size[n] = (tmp_path / "map.h5").stat().st_size
        again = load_inverse_map(tmp_path / "map.h5")
        np.testing.assert_array_equal(again.gauge_covariance, held.gauge_covariance)
        np.testing.assert_array_equal(again.own_error_strain, held.own_error_strain)
    assert size[512] < 2.2 * size[256]
