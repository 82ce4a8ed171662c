"""``strainfmu tare``: zeros from a recording, used by ``estimate``; one line for what is refused."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from ogive import OGIVE
from recorded_case import NAMES, samples, write_csv
from synthetic_vehicle import N_GAUGES, SyntheticFiles, synthetic_inverse_map

from strainfmu.cosim.estimators.zeros_file import load_known_strain, load_zeros
from strainfmu.estimator.estimator import Estimator

pytestmark = pytest.mark.fast

Run = Callable[..., tuple[int, str, str]]

ZERO = 2e-4 * np.random.default_rng(1).normal(size=N_GAUGES)


def standing(path: Path, load: float = 0.0, pressure: bool = False) -> Path:
    """A recording of 3 s on the ground, and q_inf if that is recorded."""
    held, random, time = synthetic_inverse_map(1), np.random.default_rng(2), 0.01 * np.arange(300)
    strain = ZERO + held.noise_std * random.normal(size=(300, N_GAUGES)) + load * held.mean_strain
    headings, more = ["time", *(f"{name} [um/m]" for name in NAMES)], []
    if pressure:
        headings, more = [*headings, "dynamic_pressure"], [np.full(300, 4e4)]
    return write_csv(path, headings, time, 1e6 * strain, *more)


def test_zeros_found_on_the_ground_serve_the_flight(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    ground, zeros = standing(tmp_path / "ground.csv"), tmp_path / "zeros.toml"
    code, out, error = run("tare", synthetic.map_1, ground, "--window", "0.5:2.5", "-o", zeros)
    assert (code, error) == (0, "")
    assert "6 zeros from 201 samples" in out
    assert "taken on trust" in out
    held = synthetic_inverse_map(1)
    found = load_zeros(zeros, held.gauge_names)
    assert np.all(np.abs(found.value - ZERO) < 5.0 * found.std)
    np.testing.assert_allclose(found.std, held.noise_std / np.sqrt(201), rtol=0.7)
    time, strain, q = samples(20)
    flight = write_csv(tmp_path / "flight.csv", ["time", *NAMES, "dynamic_pressure"], time, strain + ZERO, q)
    code, _, error = run("estimate", synthetic.map_1, flight, "-o", tmp_path / "o.h5", "--zeros", zeros)
    assert (code, error) == (0, "")
    with h5py.File(tmp_path / "o.h5") as file:
        c_n, sigma = file["C_N"][()], file["sigma.C_N"][()]
    truth = Estimator(held).estimate(strain, q).coefficients[:, 1]
    assert np.all(np.abs(c_n - truth) < 3.0 * sigma)


def test_the_last_sample_stands_for_the_time_up_to_the_next(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    """300 samples at 100 Hz are 3 s, the last of them at 2.99 s."""
    ground = standing(tmp_path / "g.csv")
    code, out, _ = run("tare", synthetic.map_1, ground, "--window", "0:3", "-o", tmp_path / "zeros.toml")
    assert code == 0
    assert "6 zeros from 300 samples" in out


def test_a_recording_that_paused_reaches_no_further(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    """Its mean time between samples is 3.4 s, that of nearly all of them 0.01 s."""
    time = 0.01 * np.arange(300) + np.where(np.arange(300) < 100, 0.0, 1000.0)
    strain = ZERO + 1e-7 * np.random.default_rng(2).normal(size=(300, N_GAUGES))
    ground = write_csv(tmp_path / "g.csv", ["time", *NAMES], time, strain)
    code, _, error = run("tare", synthetic.map_1, ground, "--window", "1001:1005", "-o", tmp_path / "zeros.toml")
    assert (code, error.count("\n")) == (2, 1)
    assert "window: expected within the recording, 0 to 1002.99 s, got 1001 to 1005 s" in error


def test_refused_while_loads_are_not_known(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    ground, zeros = standing(tmp_path / "g.csv", pressure=True), tmp_path / "zeros.toml"
    code, _, error = run("tare", synthetic.map_1, ground, "--window", "0:2", "-o", zeros)
    assert code == 1
    expected = "loads are not known: dynamic pressure reaches 4e+04 Pa, expected at most 100 Pa; no zeros written"
    assert error.strip() == f"strainfmu: {ground}: {expected}"
    assert not zeros.exists()
    code, out, _ = run("tare", synthetic.map_1, ground, "--window", "0:2", "-o", zeros, "--accept")
    assert code == 0
    assert "accepted: loads are not known" in out
    assert "accepted = " in zeros.read_text()


def test_refused_where_half_of_the_gauges_do_not_read(synthetic: SyntheticFiles, tmp_path: Path, run: Run) -> None:
    """As by an FMU's input and on the bus; what is recorded of the dynamic pressure is counted."""
    time, zeros = 0.01 * np.arange(300), tmp_path / "zeros.toml"
    strain = 1e6 * ZERO + 0.1 * np.random.default_rng(2).normal(size=(300, N_GAUGES))
    strain[:, N_GAUGES // 2 - 1 :] = np.nan
    pressure = np.where(time > 0.995, np.nan, 0.0)
    headings = ["time", *(f"{name} [um/m]" for name in NAMES), "dynamic_pressure"]
    ground = write_csv(tmp_path / "g.csv", headings, time, strain, pressure)
    code, out, error = run("tare", synthetic.map_1, ground, "--window", "0:2", "-o", zeros)
    line = f"strainfmu: {ground}: {N_GAUGES // 2 - 1} of {N_GAUGES} gauges read; no zeros written\n"
    assert (code, error) == (1, line)
    assert "dynamic pressure has no value in 101 of 201 samples" in out
    assert not zeros.exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--window", "0-2"), "--window: expected FROM:TO in seconds, as 0:10, got '0-2'"),
        (("--window", "2:0"), "window: expected a begin before its end, got 2 to 0 s"),
        (("--window", "0:5"), "g.csv: window: expected within the recording, 0 to 2.99 s, got 0 to 5 s"),
        (("--window", "-1:2"), "g.csv: window: expected within the recording, 0 to 2.99 s, got -1 to 2 s"),
        (("--window", "0:0.1"), "g.csv: window: expected at least 64 samples, got 11"),
        (
            ("--window", "0:2", "--ambient-pressure", "1e5"),
            "--ambient-pressure: expected with --vehicle, got it alone",
        ),
    ],
)
def test_wrong_options_get_one_line(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run, options: tuple[str, ...], message: str
) -> None:
    code, _, error = run("tare", synthetic.map_1, standing(tmp_path / "g.csv"), *options)
    assert code == 2
    assert message in error
    assert len(error.strip().splitlines()) == 1


def test_strain_of_loads_on_the_ground_is_written_for_the_bus(
    synthetic: SyntheticFiles, tmp_path: Path, run: Run
) -> None:
    ground, known = standing(tmp_path / "g.csv"), tmp_path / "known.toml"
    plain = ("tare", synthetic.map_1, ground, "--window", "0:2", "-o")
    of_air = ("--vehicle", OGIVE, "--ambient-pressure", "1e6", "--known-output", known)
    assert run(*plain, tmp_path / "a.toml")[0] == 0
    code, _, error = run(*plain, tmp_path / "b.toml", *of_air)
    assert (code, error) == (0, "")
    found = load_known_strain(known, NAMES)
    assert np.all(found.value < 0.0), "air squeezes the wall"
    np.testing.assert_allclose(found.std, 0.02 * np.abs(found.value))
    without, with_air = (load_zeros(tmp_path / name, NAMES).value for name in ("a.toml", "b.toml"))
    np.testing.assert_allclose(without - with_air, found.value, rtol=1e-6)
    code, _, error = run(*plain, tmp_path / "c.toml", "--known-output", known)
    assert (code, "--known-output: expected with --vehicle, got it alone" in error) == (2, True)
