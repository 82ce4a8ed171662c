"""One hour of bus time at 1 kHz, virtual: every cycle answered, and the memory does not grow."""

from __future__ import annotations

import gc
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from can_case import Projection, Truth

from strainfmu.can.core import BridgeCore
from strainfmu.can.crc import protect
from strainfmu.can.frame import Frame
from strainfmu.can.frame_account import FrameClass
from strainfmu.can.profiles import profile_layout
from strainfmu.can.quality import Quality
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.strain_encoder import StrainEncoder

N_GAUGES = 6
CYCLE = 1e-3
DRIFT = 40e-6


def run(seconds: float, checks: int) -> list[int]:
    """Send for ``seconds`` of bus time, some faults; return the traced memory [byte] at ``checks`` times."""
    layout = profile_layout("fd64", [f"g{i}" for i in range(N_GAUGES)], CYCLE)
    core = BridgeCore(layout, Projection(N_GAUGES), BridgeSettings(), 0.0)
    encoder, truth = StrainEncoder(layout), Truth(N_GAUGES, 1)
    patterns = [encoder.encode(*truth.cycle(k), 0, 0.0) for k in range(1000)]
    protections = [frame.layout.protection for frame in (layout.frames[-1], *layout.frames[:-1])]
    n_cycles, valid, memory = round(seconds / CYCLE), 0, []
    for k in range(n_cycles):
        time = k * CYCLE * (1.0 + DRIFT)
        ticks = (round(k * CYCLE * 1e6) % 2**32).to_bytes(4, "little")
        lost = k % 997 == 500
        for place, (frame, protection) in enumerate(zip(patterns[k % 1000], protections, strict=True)):
            assert protection is not None
            data = protect(frame.data[:4] + ticks + frame.data[8:], protection, k)
            if not (lost and place == 1):
                for result in core.receive(replace(frame, data=data, time=time + 1e-5 * place)):
                    valid += result.quality is Quality.VALID
        if k % 53 == 0:
            core.receive(Frame(k % 2048 if k % 2048 not in (0x300, 0x301) else 0x400, b"", time + 1e-4))
        if k % (n_cycles // checks) == n_cycles // checks - 1:
            gc.collect()
            memory.append(tracemalloc.get_traced_memory()[0])
    assert core.account.unaccounted == 0
    assert core.account.classes[FrameClass.OWN] == 0
    # Each lost cycle costs itself; the first three are not believed yet.
    assert valid >= n_cycles - 3 - (n_cycles // 997 + 1)
    assert core.drift_ppm == pytest.approx(1e6 * DRIFT, abs=1.0)
    return memory


def grows(memory: list[int]) -> float:
    """Return by how much the second half of ``memory`` lies above the first [byte]."""
    half = len(memory) // 2
    return float(np.mean(memory[half:]) - np.mean(memory[1:half]))


def test_twenty_seconds_without_growth() -> None:
    tracemalloc.start()
    try:
        memory = run(20.0, 8)
    finally:
        tracemalloc.stop()
    # Windows of the drift fit fill up until a minute is over: a few hundred bytes each.
    assert grows(memory) < 20_000


@pytest.mark.slow
def test_one_hour_without_growth() -> None:
    tracemalloc.start()
    try:
        memory = run(3600.0, 60)
    finally:
        tracemalloc.stop()
    print(f"traced memory after each minute [kB]: {[round(m / 1000) for m in memory]}")
    assert grows(memory) < 20_000
