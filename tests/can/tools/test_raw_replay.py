"""A run over a raw socket, whose frames have the kernel's times: its recording is in order and gives it again."""

from __future__ import annotations

import socket
import threading
import time
from pathlib import Path

from bus_run import CYCLE, flight
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.can.bridge.bus.opening import BusSettings, open_bus
from strainfmu.can.bridge.options import BridgeOptions
from strainfmu.can.bridge.summary import BridgeSummary
from strainfmu.can.cycle.estimate.result import CycleResult
from strainfmu.can.cycle.states.quality import Quality
from strainfmu.can.tools.log_description import load_description
from strainfmu.can.tools.log_frames import LogState, log_frames
from strainfmu.can.tools.observed import observed_bridge
from strainfmu.can.tools.replay import replay_log
from strainfmu.can.tools.sender import send_flight
from strainfmu.can.wire.frame_layout import NAVIGATION
from strainfmu.can.wire.profiles import profile_layout
from strainfmu.cosim.estimators.fmu_step import FmuStep
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE

GROUP = "239.74.163.12"


def test_a_recording_of_a_raw_socket_gives_the_run_again(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    log, bus = tmp_path / "run.blf", {"interface": "udp_multicast", "channel": GROUP}
    options = BridgeOptions(**bus, bus_options=(f"port={port}",), profile="fd64", cycle_time=CYCLE)
    live: list[CycleResult] = []
    found: list[BridgeSummary] = []
    with observed_bridge(
        synthetic.estimator_1, options, record=log, publish=None, publish_rate=1.0, also=live.append
    ) as observed:
        bridge = observed.ready.bridge
        thread = threading.Thread(target=lambda: found.append(bridge.run()))
        thread.start()
        time.sleep(0.1)
        with open_bus(BusSettings(**bus, options={"port": port})) as sender:
            layout = profile_layout("fd64", [f"G{i}" for i in range(N_GAUGES)], CYCLE)

            def is_enough() -> bool:
                return sum(result.quality is Quality.VALID for result in live) >= 30

            send_flight(sender, layout, samples=flight(3000), stopped=is_enough)
        time.sleep(0.1)
        bridge.stop()
        thread.join(120.0)
        observed.notes()
    assert found[0].qualities[Quality.VALID] >= 30
    state, described = LogState(), load_description(log)
    assert described is not None
    times = [frame.time for frame, _ in log_frames(log, described["log_start"], state)]
    assert (state.backwards, state.ends_early) == (0, ""), "sent and received frames are in order of their times"
    assert len(times) >= 90
    again: list[CycleResult] = []
    with FmuStep(synthetic.estimator_1, NAVIGATION, (ENVELOPE_SCORE,)) as step:
        replay_log(
            log,
            synthetic.estimator_1,
            step=step,
            gauge_names=step.gauge_names,
            options=lambda recorded: recorded or options,
            on_result=again.append,
        )
    assert [(r.sample_time, r.counter) for r in again] == [(r.sample_time, r.counter) for r in live]
    for now, then in zip(again, live, strict=True):
        # What went out too late was STALE, which no replay knows.
        assert now.quality is then.quality or then.quality is Quality.STALE
        assert (now.coefficients.tolist() == then.coefficients.tolist()) or not then.quality.has_coefficients
