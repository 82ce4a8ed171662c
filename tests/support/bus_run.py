"""A short live run over a virtual bus: a bridge of the synthetic FMU, fed by the virtual sender, with watchers."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from synthetic_vehicle import N_GAUGES, synthetic_inverse_map

from strainfmu.atmosphere import dynamic_pressure
from strainfmu.can.bridge.bus import BusSettings, open_bus
from strainfmu.can.bridge.freshness_file import freshness_file, next_trip
from strainfmu.can.bridge.setup import BridgeOptions, input_layout
from strainfmu.can.bridge.summary import BridgeSummary
from strainfmu.can.cycle.result import CycleResult
from strainfmu.can.tools.faults import Fault
from strainfmu.can.tools.observed import observed_bridge
from strainfmu.can.tools.sender import send_flight
from strainfmu.can.tools.strain_sources import FlownSample

CYCLE = 0.01


@dataclass
class LiveRun:
    """Results and summary of the bridge, and the notes of its recorder and publisher."""

    results: list[CycleResult]
    summary: BridgeSummary
    notes: list[str]


def flight(n_cycles: int, navigated: bool = False) -> list[FlownSample]:
    """Return pressure states that move, seen by the gauges of the synthetic map, with its noise."""
    inverse_map = synthetic_inverse_map(1)
    random = np.random.default_rng(2)
    state = 1e5 * np.sin(0.05 * np.arange(n_cycles)[:, None] + np.arange(3.0))
    strain = inverse_map.mean_strain + state @ inverse_map.state_operator.T
    strain += 1e-7 * random.normal(size=strain.shape)
    pressure = 9e4 + np.arange(n_cycles)
    mach = np.sqrt(pressure / dynamic_pressure(1.0, 20e3)) if navigated else np.full(n_cycles, np.nan)
    altitude = np.where(np.isnan(mach), np.nan, 20e3)
    return [
        FlownSample(d, float(q), np.full(5, np.nan), float(m), float(h))
        for d, q, m, h in zip(strain, pressure, mach, altitude, strict=True)
    ]


def live_run(
    fmu: Path,
    channel: str,
    n_cycles: int = 60,
    faults: tuple[Fault, ...] = (),
    record: Path | None = None,
    publish: str | None = None,
    profile: str = "fd64",
    stall: tuple[int, float] = (-1, 0.0),
    navigated: bool = False,
    key: Path | None = None,
) -> LiveRun:
    """Run a bridge on the virtual channel while the sender sends ``n_cycles``.

    ``navigated`` sends Mach number and altitude too; ``key`` is that of profile fd64-sec. ``stall`` is the number
    of a result behind which the bridge stands still, and for how long [s].
    """
    options = BridgeOptions(interface="virtual", channel=channel, profile=profile, cycle_time=CYCLE, key_file=key)
    settings = BusSettings(interface="virtual", channel=channel)
    results: list[CycleResult] = []

    def keep(result: CycleResult) -> None:
        results.append(result)
        if len(results) == stall[0]:
            time.sleep(stall[1])

    with observed_bridge(fmu, options, record=record, publish=publish, publish_rate=1000.0, also=keep) as observed:
        bridge = observed.ready.bridge
        found: list[BridgeSummary] = []
        thread = threading.Thread(target=lambda: found.append(bridge.run()))
        thread.start()
        time.sleep(0.1)
        bus = open_bus(settings)
        layout, _ = input_layout(options, [f"G{i}" for i in range(N_GAUGES)])
        trip = 1 if layout.key is None or key is None else next_trip(freshness_file(key, "sender"), layout.key)
        send_flight(bus, layout, samples=flight(n_cycles, navigated), faults=faults, trip=trip)
        time.sleep(0.1)
        bridge.stop()
        thread.join(10.0)
        bus.shutdown()
        return LiveRun(results, found[0], observed.notes())
