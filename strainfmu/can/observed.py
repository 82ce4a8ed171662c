"""A bridge with an optional recorder and an optional publisher."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from strainfmu.can.bridge import Bridge
from strainfmu.can.listener import Taps
from strainfmu.can.machine import Result
from strainfmu.can.options import BridgeOptions
from strainfmu.can.page_message import PAGE_OUTPUTS, estimator_facts, field_messages, gauge_positions
from strainfmu.can.publisher import Publisher, parsed_address
from strainfmu.can.recording import MicrosecondClock, Recorder
from strainfmu.can.setup import ReadyBridge, make_bridge
from strainfmu.errors import InputError


@dataclass
class ObservedBridge:
    """A bridge that is ready, its recorder and its publisher."""

    ready: ReadyBridge
    recorder: Recorder | None
    publisher: Publisher | None

    def close_recording(self) -> None:
        """Close the recording with what a replay must know of the run; further calls do nothing."""
        if self.recorder is not None:
            bridge = self.ready.bridge
            self.recorder.close(bridge.listener.known, bridge.machine.stalls, bridge.skips)

    def notes(self) -> list[str]:
        """Close the recording and return a line on each watcher."""
        lines = []
        self.close_recording()
        if self.recorder is not None:
            lines.append(
                f"{self.recorder.path}: {self.recorder.recorded} frames recorded, {self.recorder.lost} lost"
            )
            if self.recorder.failure:
                lines.append(f"{self.recorder.path}: recording ended early: {self.recorder.failure}")
        if self.ready.freshness is not None and self.ready.freshness.failure_text:
            lines.append(self.ready.freshness.failure_text)
        if self.ready.zeros is not None:
            self.ready.zeros.finish()
            lines += self.ready.zeros.lines
        if self.publisher is not None:
            lines.append(f"datagrams: {self.publisher.sent} sent, {self.publisher.dropped} dropped")
        return lines


@contextmanager
def observed_bridge(
    fmu: Path,
    options: BridgeOptions,
    record: Path | None,
    publish: str | None,
    publish_rate: float,
    also: Callable[[Result], None] | None = None,
    publish_field: Path | None = None,
    publish_token: str | None = None,
    clock: MicrosecondClock | None = None,
) -> Iterator[ObservedBridge]:
    """Make a bridge whose frames are recorded in ``record`` and whose results go to ``publish`` ("host:port").

    ``also`` is called with every result before the publisher. ``publish_field`` is a map of the same gauges that
    holds the pressure field: the publisher's thread sends that too. ``publish_token`` is stated in every datagram.
    ``clock`` is the run's, None for the machine's.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`~strainfmu.can.setup.make_bridge`, :class:`Recorder` and :class:`Publisher`.
    """
    if publish is not None and not 0.0 < publish_rate <= 10_000.0:
        raise InputError(f"page.rate_hz: expected more than 0 and at most 10,000 Hz, got {publish_rate:g}")
    address = None if publish is None else parsed_address(publish, "page.publish")
    positions = () if address is None else gauge_positions(fmu)
    if publish_field is not None and address is None:
        raise InputError("page.field: expected with page.publish, got it alone")
    names = tuple(position.name for position in positions)
    field = None if publish_field is None else field_messages(publish_field, names)
    watchers = [] if also is None else [also]
    publisher = None

    def on_result(result: Result) -> None:
        for watcher in watchers:
            watcher(result)

    with ExitStack() as stack:
        recorder = None
        if record is not None:
            recorder = Recorder(record, clock or MicrosecondClock())
            stack.callback(recorder.close)
        taps = Taps(
            clock=(clock or time.monotonic) if recorder is None else recorder.clock,
            on_received=None if recorder is None else recorder.received,
            on_sent=None if recorder is None else recorder.sent,
            on_result=on_result,
        )
        if options.synchronised is not None:
            # The system's time is synchronised by PTP or NTP, if anything is.
            options = replace(options, synchronised_shift=time.time() - taps.clock())
        ready = stack.enter_context(
            make_bridge(
                fmu,
                options,
                taps,
                on_zeros=(lambda _: None) if field is None else field.set_zeros,
                outputs=() if address is None else PAGE_OUTPUTS,
            )
        )
        if recorder is not None:
            keeper = ready.freshness
            freshness = None if keeper is None else keeper.start
            first = int(ready.bridge.machine.plan.record["first_result"][0])
            recorder.describe(fmu, options, ready.start, first, freshness=freshness)
        if address is not None:
            bridge = ready.bridge
            publisher = Publisher(
                address,
                positions,
                rate=publish_rate,
                account=bridge.account,
                report=lambda: _report(bridge, recorder, f"{options.interface}:{options.channel}"),
                facts=estimator_facts(fmu),
                field=field,
                token=publish_token,
            )
            watchers.append(publisher.result)
            stack.callback(publisher.close)
        observed = ObservedBridge(ready, recorder, publisher)
        stack.callback(observed.close_recording)
        yield observed


def _report(bridge: Bridge, recorder: Recorder | None, name: str) -> dict[str, Any]:
    """Return what a display shows of the bus and of the recording."""
    summary = bridge.listener.summary
    report: dict[str, Any] = {
        "bus_state": bridge.machine.bus_state.name,
        "bus": {"name": name, "last_fault": summary.last_fault, "reconnects": summary.reconnects},
        "period_text": bridge.machine.period_text,
    }
    if recorder is not None:
        report["recording"] = {
            "file": recorder.path.name,
            "frames": recorder.recorded,
            "lost": recorder.lost,
            "failure": recorder.failure,
        }
    return report
