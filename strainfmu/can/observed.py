"""A live bridge of an estimator FMU, with an optional recorder and an optional publisher."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from strainfmu.can.authentic import FreshnessKeeper
from strainfmu.can.bridge import Bridge
from strainfmu.can.frame import import_can
from strainfmu.can.frame_layout import NAVIGATION
from strainfmu.can.listener import Taps
from strainfmu.can.machine import Result
from strainfmu.can.opening import VIRTUAL, VIRTUAL_TEXT, bus_settings, open_bus
from strainfmu.can.options import PUBLISH_RATE, BridgeOptions
from strainfmu.can.page_message import PAGE_OUTPUTS, estimator_facts, field_messages, gauge_positions
from strainfmu.can.publisher import Publisher, parsed_address
from strainfmu.can.recording import MicrosecondClock, Recorder
from strainfmu.can.setup import key_of, live_listener
from strainfmu.can.tare import ZerosKeeper
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE, OTHER_LOAD_OUTPUTS, PARAMETERS
from strainfmu.errors import InputError
from strainfmu.estimator.gauge_zeros import GaugeZeros
from strainfmu.interface.input_names import OTHER_AIR_DATA

UNPROTECTED_TEXT = (
    "UNPROTECTED: no CRC with counter covers every byte of the input; errors of transmission may pass unseen, and "
    "no result is VALID"
)
"""Word at the start of a bridge whose input is not protected end to end."""

UNLOADED_TEXT = (
    "tare: strains of own weight and of ambient air count as zeros; state them as tare.known where they matter"
)
"""Word at the start of a bridge that takes tares without knowing of loads on the ground."""


@dataclass(kw_only=True)
class ObservedBridge:
    """A bridge that is ready, and what watches it.

    Attributes
    ----------
    freshness : keeps the freshness value of authenticated frames; None where they are not authenticated.
    zeros : keeps the zeros of tares; None where tares are not taken.
    start_lines : what a user must know before the run: options that were not given, lack of protection.
    """

    bridge: Bridge
    freshness: FreshnessKeeper | None
    zeros: ZerosKeeper | None
    recorder: Recorder | None
    publisher: Publisher | None
    start_lines: tuple[str, ...]

    def close_recording(self) -> None:
        """Close the recording with what a replay must know of the run; further calls do nothing."""
        if self.recorder is not None:
            self.recorder.close(self.bridge.listener.known, self.bridge.machine.stalls, self.bridge.skips)

    def notes(self) -> list[str]:
        """Close the recording and return a line on each watcher."""
        lines = []
        self.close_recording()
        if (recorder := self.recorder) is not None:
            lines.append(f"{recorder.path}: {recorder.recorded} frames recorded, {recorder.lost} lost")
            if recorder.failure:
                lines.append(f"{recorder.path}: recording ended early: {recorder.failure}")
        if self.freshness is not None and self.freshness.failure_text:
            lines.append(self.freshness.failure_text)
        if self.zeros is not None:
            self.zeros.finish()
            lines += self.zeros.lines
        if self.publisher is not None:
            lines.append(f"datagrams: {self.publisher.sent} sent, {self.publisher.dropped} dropped")
        return lines


@contextmanager
def observed_bridge(
    fmu: Path,
    options: BridgeOptions,
    *,
    record: Path | None = None,
    publish: str | None = None,
    publish_rate: float = PUBLISH_RATE,
    publish_field: Path | None = None,
    publish_token: str | None = None,
    also: Callable[[Result], None] | None = None,
    on_zeros: Callable[[GaugeZeros], None] | None = None,
    clock: MicrosecondClock | None = None,
) -> Iterator[ObservedBridge]:
    """Load the FMU, connect a bridge to it, and free the FMU at the end.

    Parameters
    ----------
    record : recording of the frames; None for none.
    publish, publish_rate : where results go ("host:port"), and the largest number a second [Hz].
    publish_field : map of the same gauges that holds the pressure field: the publisher's thread sends that too.
    publish_token : stated in every datagram.
    also : called with every result before the publisher.
    on_zeros : called with zeros of the gauges that the estimator takes off from then on, given or of a tare.
    clock : of the run, None for the recorder's, or the machine's.

    Raises
    ------
    InputError
        An option, a file or the FMU is wrong.
    StrainfmuError
        Something needed is not installed, a file cannot be written, or the FMU cannot be loaded.
    """
    import_can()
    from strainfmu.cosim.estimators.fmu_step import SENSORS, TEMPERATURE, FmuStep
    from strainfmu.cosim.estimators.zeros_file import load_zeros

    address = _page_address(publish, publish_rate, publish_field)
    positions = () if address is None else gauge_positions(fmu)
    field = None if publish_field is None else field_messages(publish_field, tuple(p.name for p in positions))
    on_result = [] if also is None else [also]
    of_zeros = on_zeros, None if field is None else field.set_zeros

    def use_zeros(zeros: GaugeZeros) -> None:
        for watcher in filter(None, of_zeros):
            watcher(zeros)

    def pass_on(result: Result) -> None:
        for watcher in on_result:
            watcher(result)

    with ExitStack() as stack:
        recorder = None
        if record is not None:
            recorder = stack.enter_context(closing(Recorder(record, clock or MicrosecondClock())))
        taps = Taps(
            clock=(clock or time.monotonic) if recorder is None else recorder.clock,
            queue=None if recorder is None else recorder.queue,
            on_result=pass_on,
        )
        if options.synchronised is not None:
            # The system's time is synchronised by PTP or NTP, if anything is.
            options = replace(options, synchronised_shift=time.time() - taps.clock())
        bus = bus_settings(options.interface, options.channel, options.bus_options)
        key_of(options)  # refused before the FMU is unpacked
        inputs = (*NAVIGATION, *OTHER_AIR_DATA, TEMPERATURE, SENSORS, PARAMETERS)
        outputs = (ENVELOPE_SCORE, OTHER_LOAD_OUTPUTS, *(() if address is None else PAGE_OUTPUTS))
        step = stack.enter_context(FmuStep(fmu, inputs, outputs))
        if options.zeros is not None:
            step.set_zeros(new_zeros := load_zeros(options.zeros, step.gauge_names))
            use_zeros(new_zeros)
        listener, taring, freshness = live_listener(stack, step, options, step.gauge_names, taps)
        zeros = None
        if taring is not None:
            path, source = options.tare_output or Path("zeros.toml"), f"{options.interface}:{options.channel}"
            zeros = stack.enter_context(ZerosKeeper(path, step.gauge_names, source, use_zeros))
            taring.on_end = zeros.ended
        bridge, machine = Bridge(listener, lambda: open_bus(bus), options.max_age), listener.machine
        if recorder is not None:
            reached = None if freshness is None else freshness.start
            first = int(machine.plan.record["first_result"][0])
            recorder.describe(fmu, options, machine.start, first, freshness=reached)
        publisher = None
        if address is not None:
            publisher = Publisher(
                address,
                positions,
                rate=publish_rate,
                account=bridge.account,
                report=lambda: _report(bridge, recorder, str(bus)),
                facts=estimator_facts(fmu),
                field=field,
                token=publish_token,
            )
            on_result.append(stack.enter_context(closing(publisher)).result)
        observed = ObservedBridge(
            bridge=bridge,
            freshness=freshness,
            zeros=zeros,
            recorder=recorder,
            publisher=publisher,
            start_lines=_start_lines(options, machine.layout.is_protected, freshness),
        )
        stack.callback(observed.close_recording)
        yield observed


def _page_address(publish: str | None, rate: float, field: Path | None) -> tuple[str, int] | None:
    """Return where results go, None for nowhere; refuse entries of the section [page] that cannot be."""
    if publish is None and field is not None:
        raise InputError("page.field: expected with page.publish, got it alone")
    if publish is not None and not 0.0 < rate <= 10_000.0:
        raise InputError(f"page.rate_hz: expected more than 0 and at most 10,000 Hz, got {rate:g}")
    return None if publish is None else parsed_address(publish, "page.publish")


def _start_lines(options: BridgeOptions, is_protected: bool, freshness: FreshnessKeeper | None) -> tuple[str, ...]:
    lines = {
        UNPROTECTED_TEXT: not is_protected,
        VIRTUAL_TEXT: options.interface == VIRTUAL,
        UNLOADED_TEXT: options.tare is not None and options.tare_known is None,
        "" if freshness is None else freshness.first_run_text: True,
    }
    return tuple(line for line, is_said in lines.items() if line and is_said)


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
