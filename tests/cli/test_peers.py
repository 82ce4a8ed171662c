"""``strainfmu bench --peers``: each program is in the table, with its time or the reason why it has none."""

from collections.abc import Callable, Iterator, Sequence
from math import isfinite
from pathlib import Path
from time import perf_counter

import pytest
from synthetic_vehicle import synthetic_inverse_map

from builder.reports.growth import GrowthRow
from strainfmu.cli import peers
from strainfmu.estimator.map.inverse_map import save_inverse_map

Run = Callable[..., tuple[int, str, str]]


def time_of_one_call(call: Callable[[], object], **_: object) -> float:
    start = perf_counter()
    call()
    return perf_counter() - start


def growth_rows(path: Path, solver_names: Sequence[str], sizes: Sequence[int]) -> Iterator[GrowthRow]:
    """Yield rows as of the structure's own benchmark, whose test measures them."""
    del path
    for name in solver_names:
        yield GrowthRow(
            solver=name, n_dof=sizes[0], n_gauges=54, n_pressures=100, seconds=1.0, peak_memory=2**30,
            relative_residual=0.0, probe_residual=0.0,
        )  # fmt: skip


def test_every_program_has_a_time_or_a_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    for name, value in {"SAMPLES": 300, "TRAINING": 50, "CYCLES": 3, "time_per_call": time_of_one_call}.items():
        monkeypatch.setattr(peers, name, value)
    monkeypatch.setitem(peers.MODULES, "scikit-learn", "module_that_nobody_has")
    monkeypatch.setattr("builder.reports.growth.growth_rows", growth_rows)
    save_inverse_map(synthetic_inverse_map(n_gauges=12), tmp_path / "map.h5")
    rows = peers.bench_peers(tmp_path)
    assert all(isfinite(row.seconds) != bool(row.reason) for row in rows)
    assert {row.reason for row in rows if row.program == "scikit-learn"} == {"not installed"}
    firsts = {row.task: row.program for row in reversed(rows)}
    assert len(firsts) == 7
    assert all(program.startswith("strainfmu ") for program in firsts.values())
    monkeypatch.setattr("strainfmu.bench_peers", lambda folder: rows)
    code, printed, _ = run("bench", tmp_path, "--peers")
    assert code == 0
    for row in rows:
        assert row.program in printed
