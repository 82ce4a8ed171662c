"""The benchmarks under ``benchmarks/`` run: each once, without asv."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

NAMES = (
    "building.Flow",
    "building.Structure",
    "run_time.BusCycles",
    "run_time.NativeStep",
    "run_time.PythonStep",
)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.usefixtures("compiled_solver")
def test_benchmark_runs(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path, str(ROOT)])
    monkeypatch.setattr("strainfmu.fmu.checks.step_cost.REPEATS", 3)
    module, kind = name.split(".")
    benchmark = getattr(__import__(f"benchmarks.{module}", fromlist=[kind]), kind)()
    cached = [benchmark.setup_cache()] if hasattr(benchmark, "setup_cache") else []
    if hasattr(benchmark, "setup"):
        benchmark.setup()
    for method in dir(benchmark):
        if method.startswith("time_"):
            getattr(benchmark, method)()
        if method.startswith("track_"):
            assert isinstance(getattr(benchmark, method)(*cached), float)
    if hasattr(benchmark, "teardown"):
        benchmark.teardown()
