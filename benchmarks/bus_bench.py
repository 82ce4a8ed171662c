"""The benchmark of the bus: the core in virtual time, a bridge at a given rate, python-can's own loop next to it.

Sender, bridge and python-can's loop are processes of their own over udp_multicast. The sender measures by how much
it is late itself: a cycle counts for the bridge only if it was sent on time.
"""

import argparse
import os
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.bench_flight import PROFILE, BenchFlight, bench_flight
from builder.pipeline.demonstration.bus_flight import GROUP, check_multicast, private_port
from strainfmu.can.encoder import frame_of
from strainfmu.can.frame import import_can, to_message
from strainfmu.can.frame_layout import NAVIGATION, FrameLayout
from strainfmu.can.listener import BridgeSummary
from strainfmu.can.machine import Result
from strainfmu.can.observed import observed_bridge
from strainfmu.can.opening import BusSettings, open_bus, shut_down
from strainfmu.can.options import PUBLISH_RATE, BridgeOptions
from strainfmu.can.profiles import BRIDGE, profile_layout
from strainfmu.can.quality import Quality
from strainfmu.can.recording import MicrosecondClock, Recorder
from strainfmu.can.setup import all_layouts, make_machine
from strainfmu.cli.commands.can_bus import PERCENTILES
from strainfmu.cosim.estimators.step import ENVELOPE_SCORE
from strainfmu.errors import StrainfmuError
from strainfmu.estimator.map.inverse_map import InverseMap, load_inverse_map
from strainfmu.fmu.export import ExportOptions, export_estimator

SETTLING_CYCLES = 100
"""Cycles at the start in which the bridge comes to trust its input, and which are not counted."""

ON_TIME = 0.5
"""Maximum lateness of a cycle's last frame [cycles] that counts as on time: later, it is the sender's fault."""

PYTHON_CAN_DURATION = 10.0
"""Maximum duration for which python-can's own loop is measured [s]."""

_PATIENCE = 60.0
_SHORTEST_SLEEP = 5e-5
_SPAWN = get_context("spawn")


@dataclass(kw_only=True)
class CoreCost:
    """Processor time per cycle [s]: of the core, and with result frames, page and recorder next to it."""

    core: float
    observed: float


@dataclass(kw_only=True)
class BusRun:
    """What became of the cycles of a run at a fixed rate.

    Attributes
    ----------
    rate, duration : cycles per second; length of the run [s].
    burners : niced processes that kept the processors busy meanwhile.
    sent, on_time : number of counted cycles that were sent, and of these on time.
    lateness : percentiles 50, 99 and 100 of the sender's own lateness [s].
    outcome : what the on-time cycles came to, by quality and causes; cycles without a result by name.
    summary : of the bridge.
    python_can_load, answered_load : fraction of a core that python-can's loop took to receive and count the same
        frames; and to send the bridge's number of result frames on top, which come back as they do to the bridge.
    python_can_received, python_can_sent : frames that it received, and that were sent to it.
    """

    rate: float
    duration: float
    burners: int
    sent: int
    on_time: int
    lateness: tuple[float, ...]
    outcome: Counter[str]
    summary: BridgeSummary
    python_can_load: float
    answered_load: float
    python_can_received: int
    python_can_sent: int

    @property
    def load(self) -> float:
        """Fraction of a core that the bridge took, page and recorder included."""
        return self.summary.cpu / self.summary.duration

    @property
    def valid(self) -> float:
        """Fraction of the on-time cycles that were answered as VALID."""
        return self.outcome[Quality.VALID.name] / max(self.on_time, 1)


# --- virtual time -----------------------------------------------------------------------------------------------


def core_cost(folder: Path, n_cycles: int = 5000) -> CoreCost:
    """Return what a cycle at 1 kHz costs in virtual time; ``folder`` holds map.h5 and estimator.fmu.

    Raises
    ------
    InputError
        A file is missing or damaged.
    """
    return _cost_of(folder / "estimator.fmu", load_inverse_map(folder / "map.h5"), n_cycles)


def linear_cost(folder: Path, n_cycles: int = 5000) -> CoreCost | None:
    """Return the same with the linear estimator of the map, whose step costs next to nothing: the bridge's own.

    None where the map has no other. Raises as :func:`core_cost`.
    """
    inverse_map = load_inverse_map(folder / "map.h5")
    if inverse_map.manifold is None:
        return None
    with tempfile.TemporaryDirectory(prefix="strainfmu_") as temporary:
        linear = Path(temporary) / "linear.fmu"
        export_estimator(folder / "map.h5", linear, ExportOptions(estimator="linear"))
        return _cost_of(linear, inverse_map, n_cycles)


def _cost_of(fmu: Path, inverse_map: InverseMap, n_cycles: int) -> CoreCost:
    flight = bench_flight(inverse_map, 1e-3)
    alone = _through_core(fmu, flight, n_cycles, recorder=None)
    with tempfile.TemporaryDirectory(prefix="strainfmu_") as temporary:
        recorder = Recorder(Path(temporary) / "bench.blf", MicrosecondClock())
        observed = _through_core(fmu, flight, n_cycles, recorder)
    return CoreCost(core=alone, observed=observed)


def _through_core(fmu: Path, flight: BenchFlight, n_cycles: int, recorder: Recorder | None) -> float:
    """Return the processor time per cycle of the whole process [s]; with a recorder, also results and a page."""
    from strainfmu.can.page_message import gauge_positions
    from strainfmu.can.publisher import Publisher
    from strainfmu.cosim.estimators.fmu_step import FmuStep

    period = flight.layout.cycle_time
    cycles = [[replace(f, time=f.time + 1e-5 * i) for i, f in enumerate(flight.cycle(k))] for k in range(n_cycles)]
    options = BridgeOptions(
        interface="virtual", channel="bench", profile=PROFILE, cycle_time=period, restart="accept"
    )
    with FmuStep(fmu, NAVIGATION, (ENVELOPE_SCORE,)) as step:
        core, layouts, configuration, _ = make_machine(step, options, gauge_names=step.gauge_names, start=0.0)
        if recorder is None:
            begin = time.process_time()
            for frames in cycles:
                for frame in frames:
                    core.receive(frame)
            return (time.process_time() - begin) / n_cycles
        core.compose(layouts, configuration)
        core.log_to(recorder.queue)
        publisher = Publisher(
            ("127.0.0.1", 9), gauge_positions(fmu), rate=PUBLISH_RATE, account=lambda: core.account
        )
        begin = time.process_time()
        for frames in cycles:
            for frame in frames:
                for result in core.receive(frame):
                    for answer in result.frames:
                        answer.time = result.time
                        recorder.queue.put(answer, False)
                    publisher.result(result)
        recorder.close()
        spent = time.process_time() - begin
        publisher.close()
    return spent / n_cycles


# --- real time ------------------------------------------------------------------------------------------------


def bus_run(folder: Path, rate: float, duration: float, burners: int = 0) -> BusRun:
    """Run sender and bridge at ``rate`` [Hz] for ``duration`` [s], then python-can's loop; return what came of it.

    The bridge records to a file and publishes to a page meanwhile. ``burners`` niced processes compete with both.

    Raises
    ------
    InputError, StrainfmuError
        A file is missing or damaged; there is no route for multicast, or a process failed.
    """
    frames = all_layouts(folder / "estimator.fmu", _options(rate, 0))
    results = [frame for frame in frames if frame.sender == BRIDGE and frame.cycle_time is not None]
    gauge_names = load_inverse_map(folder / "map.h5").gauge_names
    n_frames = profile_layout(PROFILE, gauge_names, 1.0 / rate).cycle_length
    port = private_port()
    check_multicast(port)
    with _burning(burners), tempfile.TemporaryDirectory(prefix="strainfmu_") as temporary:
        log = Path(temporary) / "bench.blf"
        with _child(_bridge, folder, rate, port, log) as bridge:
            _expect(bridge)
            with _child(_sender, folder, rate, port, duration) as sender:
                sent: np.ndarray = _expect(sender)
            answers, summary = _ended(bridge)
        loops = []
        for sent_too in ([], results):
            with _child(_python_can, port, n_frames, sent_too) as counter:
                _expect(counter)
                with _child(_sender, folder, rate, port, min(duration, PYTHON_CAN_DURATION)) as sender:
                    again: np.ndarray = _expect(sender)
                loops.append(_ended(counter))
    (received, load), (_, answered_load) = loops
    period = 1.0 / rate
    counted = np.arange(len(sent)) >= SETTLING_CYCLES
    on_time = np.flatnonzero(counted & (sent <= ON_TIME * period))
    return BusRun(
        rate=rate,
        duration=duration,
        burners=burners,
        sent=int(counted.sum()),
        on_time=len(on_time),
        lateness=tuple(np.percentile(sent, (50.0, 99.0, 100.0)).tolist()),
        outcome=_outcome(answers, on_time, period),
        summary=summary,
        python_can_load=load,
        answered_load=answered_load,
        python_can_received=received,
        python_can_sent=n_frames * len(again),
    )


def _outcome(answers: list[tuple[int | None, str]], on_time: np.ndarray, period: float) -> Counter[str]:
    """Return what the cycles ``on_time`` came to; ``answers`` are sample times [us] and what was answered."""
    by_cycle: dict[int, str] = {}
    for ticks, text in answers:
        if ticks is not None:
            by_cycle.setdefault(round(1e-6 * ticks / period), text)
    return Counter(by_cycle.get(number, "no result") for number in on_time.tolist())


def _sender(end: Connection, folder: Path, rate: float, port: int, duration: float) -> None:
    """Send cycles on schedule; report the lateness of each one's last frame [s]."""
    flight = bench_flight(load_inverse_map(folder / "map.h5"), 1.0 / rate)
    bus = open_bus(_settings(port))
    n_cycles, period = round(rate * duration), 1.0 / rate
    lateness = np.empty(n_cycles)
    start = time.monotonic() + 0.3
    frames = flight.cycle(0)
    for number in range(n_cycles):
        due = start + number * period
        wait = due - time.monotonic()
        if wait > _SHORTEST_SLEEP:
            time.sleep(wait)
        for frame in frames:
            bus.send(to_message(frame))
        lateness[number] = time.monotonic() - due
        frames = flight.cycle(number + 1)
    time.sleep(0.2)
    shut_down(bus)
    end.send(lateness)


def _bridge(end: Connection, folder: Path, rate: float, port: int, log: Path) -> None:
    """Run a bridge with recorder and page until a request to stop; report its answers and its summary."""
    answers: list[tuple[int | None, str]] = []

    def keep(result: Result) -> None:
        is_valid = result.quality is Quality.VALID
        answers.append((result.sample_time, "VALID" if is_valid else _text_of(result)))

    fmu = folder / "estimator.fmu"
    with observed_bridge(
        fmu, _options(rate, port), record=log, publish="127.0.0.1:9", publish_rate=PUBLISH_RATE, also=keep
    ) as observed:
        bridge = observed.bridge

        def wait_for_end() -> None:
            end.recv()
            bridge.stop()

        threading.Thread(target=wait_for_end, daemon=True).start()
        threading.Timer(0.2, lambda: end.send("ready")).start()
        summary = bridge.run()
    end.send((answers, summary))


def _text_of(result: Result) -> str:
    causes = ", ".join(cause.name or "" for cause in result.causes)
    return f"{result.quality.name}: {causes or 'no cause'}"


def _python_can(end: Connection, port: int, n_frames: int, results: list[FrameLayout]) -> None:
    """Receive and count with python-can alone, and send ``results`` after every ``n_frames`` received; report the
    number of frames and the load."""
    can = import_can()
    settings = _settings(port)
    bus = can.Bus(interface=settings.interface, channel=settings.channel, **settings.options, fd=True)
    answers = [to_message(frame_of(layout, bytes(layout.length))) for layout in results]
    own = {answer.arbitration_id for answer in answers}
    end.send("ready")
    count, begin, spent = 0, 0.0, 0.0
    while not end.poll():
        for _ in range(500):
            message = bus.recv(0.1)
            if message is None:
                break
            if count == 0:
                begin, spent = time.monotonic(), time.process_time()
            last = time.monotonic()
            if message.arbitration_id in own:
                continue
            count += 1
            for answer in () if count % n_frames else answers:
                bus.send(answer, timeout=0.0)
    load = (time.process_time() - spent) / max(last - begin, 1e-9) if count else 0.0
    shut_down(bus)
    end.send((count, load))


def _options(rate: float, port: int) -> BridgeOptions:
    return BridgeOptions(
        interface="udp_multicast",
        channel=GROUP,
        bus_options=(f"port={port}",),
        profile=PROFILE,
        cycle_time=1.0 / rate,
        restart="accept",  # the sender hears no results
    )


def _settings(port: int) -> BusSettings:
    return BusSettings(interface="udp_multicast", channel=GROUP, options={"port": port, "hop_limit": 0})


def _burn(end: Connection) -> None:
    """Keep a processor busy at the lowest priority until a request to stop."""
    os.nice(19)
    while not end.poll():
        sum(range(100_000))


@contextmanager
def _burning(n: int) -> Iterator[None]:
    """Run ``n`` burners."""
    if n == 0:
        yield
        return
    with _child(_burn) as end, _burning(n - 1):
        yield
        end.send("stop")


@contextmanager
def _child(work: Any, *arguments: Any) -> Iterator[Connection]:
    """Run ``work`` in a process of its own; whatever happens, it does not outlive this."""
    here, there = _SPAWN.Pipe()
    process = _SPAWN.Process(target=work, args=(there, *arguments), daemon=True)
    process.start()
    there.close()
    try:
        yield here
        process.join(_PATIENCE)
    finally:
        if process.is_alive():
            process.terminate()
            process.join()
        here.close()


def _expect(end: Connection) -> Any:
    """Return what a process reports; its own message has gone to standard error if it failed."""
    try:
        return end.recv()
    except EOFError as error:
        raise StrainfmuError("a process of the benchmark failed") from error


def _ended(end: Connection) -> Any:
    """Tell a process to stop and return its report."""
    end.send("stop")
    return _expect(end)


# --- the table ---------------------------------------------------------------------------------------------------


def bench_bus(folder: Path, rate: float, duration: float, burners: int) -> None:
    """Run the benchmark of the bus on the map and the estimator FMU in ``folder``, and print its table.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`bus_run`.
    """
    cost, linear = core_cost(folder), linear_cost(folder)
    run = bus_run(folder, rate, duration, burners)
    title = f"Bus, {folder}: fd64, {rate:g} Hz for {duration:g} s, {burners} niced burners"
    table = Table(title=title, show_header=False)
    for name, text in bus_rows(cost, run, linear):
        table.add_row(name, text)
    Console().print(table)


def bus_rows(cost: CoreCost, run: BusRun, linear: CoreCost | None = None) -> list[tuple[str, str]]:
    """Return the rows of the table; ``linear`` is the cost with the linear estimator of the same map."""
    account = run.summary.account
    rows = [
        ("virtual time: core", _cost_text(cost.core)),
        ("virtual time: with results, page, recorder", _cost_text(cost.observed)),
    ]
    if linear is not None:
        rows += [
            ("virtual time, linear estimator: core", _cost_text(linear.core)),
            ("virtual time, linear estimator: with results, page, recorder", _cost_text(linear.observed)),
        ]
    rows += [
        ("cycles sent, of these on time", f"{run.sent}, {run.on_time}"),
        ("sender's own lateness", _percentiles((50, 99, 100), run.lateness)),
        ("on-time cycles VALID", f"{run.outcome['VALID']} ({run.valid:.2%})"),
    ]
    rows += [(f"on-time cycles {text}", str(n)) for text, n in run.outcome.most_common() if text != "VALID"]
    if len(run.summary.latency):
        values = tuple(_of(run.summary.latency, PERCENTILES))
        rows.append(("last frame in to results out", _percentiles(PERCENTILES, values)))
    rows += [(f"frames: {name}", str(count)) for name, count in account.rows()]
    rows.append(("frames: not accounted for", str(account.unaccounted)))
    drops = run.summary.kernel_drops
    rows.append(("dropped by the system", "not known" if drops is None else str(drops)))
    heard = f"{run.python_can_received} of {run.python_can_sent} frames"
    rows += [
        ("load of the bridge, page and recorder on", f"{run.load:.1%} of a core"),
        ("load of python-can's loop that receives", f"{run.python_can_load:.1%} of a core, {heard}"),
        ("load of python-can's loop that also sends the results", f"{run.answered_load:.1%} of a core"),
        ("bridge to these loops", f"{run.load / run.python_can_load:.2f} and {run.load / run.answered_load:.2f}"),
    ]
    return rows


def _cost_text(seconds: float) -> str:
    return f"{1e6 * seconds:.1f} us a cycle, {1.0 / seconds:,.0f} cycles/s"


def _of(values: object, percentiles: tuple[float, ...]) -> list[float]:
    found: list[float] = np.percentile(np.asarray(values), percentiles).tolist()
    return found


def _percentiles(names: tuple[float, ...], values: tuple[float, ...]) -> str:
    return ", ".join(f"p{name:g} {1e3 * value:.2f}" for name, value in zip(names, values, strict=True)) + " ms"


def main() -> None:
    """Print the table for the folder of a demonstration: ``python -m benchmarks.bus_bench demo``."""
    parser = argparse.ArgumentParser(description="Time the CAN bridge of the demonstration in a folder.")
    parser.add_argument("folder", type=Path, help="with map.h5 and estimator.fmu")
    parser.add_argument("--rate", type=float, default=1000.0, help="cycles per second")
    parser.add_argument("--duration", type=float, default=20.0, help="length of the run [s]")
    parser.add_argument("--burners", type=int, default=0, help="niced processes that compete for the processors")
    given = parser.parse_args()
    bench_bus(given.folder, rate=given.rate, duration=given.duration, burners=given.burners)


if __name__ == "__main__":
    main()
