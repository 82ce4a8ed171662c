"""What a recording shows of its recorder, and the entry of the vehicle file that a line names."""

from dataclasses import replace

import numpy as np
import pytest
from scaled_maps import scaled_map

from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.recorded.recorder_errors import disagreements, late_or_warm, reading_errors
from strainfmu.recorded.samples import Samples

pytestmark = pytest.mark.fast

N, RATE = 1024, 200.0
TIME = np.arange(N) / RATE


@pytest.fixture(scope="module")
def inverse_map() -> InverseMap:
    return scaled_map(2, 1, 24)


def strain_of(inverse_map: InverseMap, seed: int, noise: float = 1.0) -> np.ndarray:
    """Slow strain of a turn with ``noise`` times what the map expects."""
    random, n_d = np.random.default_rng(seed), inverse_map.n_strain_gauges
    phase = random.uniform(0.0, 2.0 * np.pi, n_d)
    size = 1e2 * np.median(inverse_map.noise_std)
    turn = size * np.sin(2.0 * np.pi * 0.5 * TIME[:, None] + phase)
    return np.asarray(turn + noise * inverse_map.noise_std[:n_d] * random.standard_normal((N, n_d)))


@pytest.mark.parametrize(
    ("kind", "named"),
    [
        ("nothing", []),
        ("noise", ["recorder.noise_um_per_m = "]),
        ("steps", ["recorder.bits"]),
        ("cable", ['recorder.pickup = "cable"']),
        ("common", ['recorder.pickup = "common"']),
    ],
)
def test_a_line_names_the_entry(inverse_map: InverseMap, kind: str, named: list[str]) -> None:
    std, random = float(np.median(inverse_map.noise_std)), np.random.default_rng(9)
    for seed in range(5):
        strain = strain_of(inverse_map, seed, 3.0 if kind == "noise" else 1.0)
        phase = random.uniform(0.0, 2.0 * np.pi, strain.shape[1]) * (kind == "cable")
        if kind in ("cable", "common"):
            strain = strain + 4.0 * std * np.sin(2.0 * np.pi * 50.0 * TIME[:, None] + phase)
        if kind == "steps":
            strain = 10.0 * std * np.round(strain / (10.0 * std))
        lines = disagreements(reading_errors(TIME, strain), inverse_map)
        assert len(lines) == len(named)
        assert all(name in line for name, line in zip(named, lines, strict=True))


def test_sizes_are_measured(inverse_map: InverseMap) -> None:
    std = float(np.median(inverse_map.noise_std))
    found = reading_errors(TIME, strain_of(inverse_map, 1, 3.0))
    assert found is not None
    assert found.noise == pytest.approx(3.0 * std, rel=0.1)
    assert found.step == 0.0
    coarse = reading_errors(TIME, 10.0 * std * np.round(strain_of(inverse_map, 1) / (10.0 * std)))
    assert coarse is not None
    assert coarse.step == pytest.approx(10.0 * std)
    assert reading_errors(TIME[:100], strain_of(inverse_map, 1)[:100]) is None


def test_what_the_file_states_is_not_named(inverse_map: InverseMap) -> None:
    noisy = strain_of(inverse_map, 2, 3.0)
    wide = replace(inverse_map, noise_std=3.0 * inverse_map.noise_std)
    assert disagreements(reading_errors(TIME, noisy), wide) == []


@pytest.mark.parametrize(("kind", "named"), [("late", "channel_ms = "), ("warm", "gradient_K"), ("none", "")])
def test_residuals_of_a_scanner_and_of_a_gradient(inverse_map: InverseMap, kind: str, named: str) -> None:
    n_d, rows = inverse_map.n_strain_gauges, slice(256)
    x = np.linspace(0.1, 1.0, n_d)
    placed = replace(inverse_map, gauge_position=np.column_stack([x, 0.0 * x, 0.0 * x]))
    std = float(np.median(inverse_map.noise_std))
    exact = strain_of(inverse_map, 3, 0.0)
    strain = strain_of(inverse_map, 3)
    if kind == "late":
        strain = strain + 1e-3 * np.arange(n_d) * np.gradient(exact, TIME, axis=0)
    if kind == "warm":
        strain = strain + 10.0 * std * x
    block = Samples(time=TIME[rows], strain=strain[rows], flow={"dynamic_pressure": np.ones(256)})
    lines = late_or_warm(block, placed, lambda one: (one.strain - exact[rows]) / std)
    assert [named in line for line in lines] == ([True] if named else [])
