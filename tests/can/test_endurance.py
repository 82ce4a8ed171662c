"""One hour of bus time at 1 kHz, virtual: every cycle answered, and the memory does not grow."""

import gc
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from can_case import Projection, Truth

from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import Frame, protect
from strainfmu.can.machine import Machine
from strainfmu.can.options import BridgeSettings
from strainfmu.can.profiles import profile_layout
from strainfmu.can.quality import FrameClass, Quality

N_GAUGES = 6
CYCLE = 1e-3
DRIFT = 40e-6


def run(seconds: float, checks: int) -> list[int]:
    """Send for ``seconds`` of bus time, some faults; return the memory [byte] at ``checks`` times."""
    layout = replace(profile_layout("fd64", [f"g{i}" for i in range(N_GAUGES)], CYCLE), state=None)
    # The sender hears no result.
    core = Machine(layout, Projection(N_GAUGES), BridgeSettings(restart="accept"), start=0.0)
    encoder, truth = StrainEncoder(layout), Truth(N_GAUGES, 1)
    patterns = [encoder.encode(*truth.cycle(k), cycle=0, sample_time=0.0) for k in range(1000)]
    pressure = layout.frame_of("dynamic_pressure")
    protections = [frame.layout.protection for frame in (pressure, *layout.strain_frames) if frame is not None]
    n_cycles, valid, memory = round(seconds / CYCLE), 0, []
    for k in range(n_cycles):
        time = k * CYCLE * (1.0 + DRIFT)
        ticks = (round(k * CYCLE * 1e6) % 2**32).to_bytes(4, "little")
        lost = k % 997 == 500
        for index, (frame, protection) in enumerate(zip(patterns[k % 1000], protections, strict=True)):
            assert protection is not None
            data = protect(frame.data[:4] + ticks + frame.data[8:], protection, k)
            if not (lost and index == 1):
                for result in core.receive(replace(frame, data=data, time=time + 1e-5 * index)):
                    valid += result.quality is Quality.VALID
        if k % 53 == 0:
            core.receive(
                Frame(identifier=k % 2048 if k % 2048 not in (0x300, 0x301) else 0x400, data=b"", time=time + 1e-4)
            )
        if k % (n_cycles // checks) == n_cycles // checks - 1:
            gc.collect()
            memory.append(resident_memory())
    assert core.account.unaccounted == 0
    assert core.account.classes[FrameClass.OWN] == 0
    # Each lost cycle costs itself; the first three are not trusted yet.
    assert valid >= n_cycles - 3 - (n_cycles // 997 + 1)
    return memory


def resident_memory() -> int:
    """Return the resident memory of this process [byte]; source: Linux, proc(5)."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def grows(memory: list[int]) -> float:
    """Return by how much the second half of ``memory`` lies above the first, its first value left out [byte]."""
    half = len(memory) // 2
    return float(np.mean(memory[half:]) - np.mean(memory[1:half]))


def test_some_seconds_without_growth() -> None:
    assert grows(run(2.0, 4)) < 1e6


@pytest.mark.slow
def test_one_hour_without_growth() -> None:
    memory = run(3600.0, 60)
    print(f"resident memory, 60 times on the way [kB]: {[round(m / 1000) for m in memory]}")
    assert grows(memory) < 1e6
