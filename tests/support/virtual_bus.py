"""A master for FMUs of FMI-LS-BUS on FMPy's interface, operations as bytes, and a sender of strains in Python."""

import ctypes
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import floor, inf
from pathlib import Path
from typing import Any, Protocol

from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave

from strainfmu.can.frame import Frame

FORMAT_ERROR, CAN, CAN_FD, CONFIRM, BUS_ERROR, CONFIGURATION = 0x01, 0x10, 0x11, 0x20, 0x31, 0x40
_NOT_YET_KNOWN, _CHANGED = 0, 2
ROUND_OFF = 1e-9


def operation(code: int, arguments: bytes) -> bytes:
    """One operation: code, length, arguments (FMI-LS-BUS 1.0, 5.2)."""
    return code.to_bytes(4, "little") + (8 + len(arguments)).to_bytes(4, "little") + arguments


def transmit(frame: Frame) -> bytes:
    """The operation that transmits a frame (5.5.1.2)."""
    head = frame.identifier.to_bytes(4, "little") + bytes([frame.is_extended])
    head += bytes([frame.is_fd and frame.bitrate_switch, 0]) if frame.is_fd else bytes([frame.is_remote])
    return operation(CAN_FD if frame.is_fd else CAN, head + len(frame.data).to_bytes(2, "little") + frame.data)


def operations(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Code and arguments of each operation."""
    position = 0
    while position < len(content):
        code, length = (int.from_bytes(content[position + k : position + k + 4], "little") for k in (0, 4))
        assert 8 <= length <= len(content) - position
        yield code, content[position + 8 : position + length]
        position += length


def frames_in(content: bytes, time: float) -> list[Frame]:
    """The frames among operations."""
    frames = []
    for code, a in operations(content):
        if code in (CAN, CAN_FD):
            head = 9 if code == CAN_FD else 8
            key = {"identifier": int.from_bytes(a[:4], "little"), "is_extended": a[4] != 0}
            assert int.from_bytes(a[head - 2 : head], "little") == len(a) - head
            frames.append(
                Frame(**key, data=a[head:], time=time, is_fd=code == CAN_FD, bitrate_switch=code == CAN_FD)
            )
    return frames


class Node(Protocol):
    """What the master links: when its transmit clock ticks next [s], what it sends then, and what it hears."""

    due: float

    def step(self, time: float, end: float) -> None: ...
    def event(self, time: float, heard: Sequence[bytes], ticks: bool) -> bytes: ...


class FmuNode:
    """An FMU with ports, in step mode between events; ``messages`` gathers (status, text) of its logger.

    ``dues`` are the next ticks of the transmit clocks by port [s].
    """

    def __init__(self, path: Path, folder: Path, start: float = 0.0, events: bool = True) -> None:
        self.description = read_model_description(str(path))
        self.numbers = {v.name: v.valueReference for v in self.description.modelVariables}
        self.ports = [name[:-8] for name in self.numbers if name.endswith(".Tx_Data")]
        self.port = self.ports[0]
        kinds = {v.name: v.intervalVariability for v in self.description.modelVariables}
        self.is_triggered = kinds[f"{self.port}.Tx_Clock"] == "triggered"
        self.messages: list[tuple[int, str]] = []
        self.fmu: Any = FMU3Slave(
            guid=self.description.guid,
            unzipDirectory=extract(str(path), str(folder)),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="node",
        )
        self.fmu.instantiate(
            loggingOn=True,
            eventModeUsed=events,
            logMessage=lambda _, status, __, text: self.messages.append((status, text.decode())),
        )
        self.start(start)

    @property
    def due(self) -> float:
        return min(self.dues.values())

    def start(self, time: float) -> None:
        """Through initialization, and the event at its end."""
        self.fmu.enterInitializationMode(startTime=time)
        self.fmu.exitInitializationMode()
        self.needs_event = False
        self.dues = dict.fromkeys(self.ports, inf)
        self.end_event(time)

    def counter(self, name: str, port: str | None = None) -> int:
        return int(self.fmu.getUInt64([self.numbers[f"{port or self.port}.{name}"]])[0])

    def step(self, time: float, end: float) -> None:
        self.needs_event = self.fmu.doStep(time, end - time)[0]

    def event(self, time: float, heard: Sequence[bytes], ticks: bool) -> bytes:
        """A whole event of an FMU with one port: what it sends."""
        self.fmu.enterEventMode()
        sent = self.sent(self.port, ticks)
        for content in heard:
            self.hear(self.port, content)
        self.end_event(time)
        return sent

    def sent(self, port: str, ticks: bool) -> bytes:
        """What a port sends in an event, where its clock ``ticks`` if the importer is to tick it."""
        data, clock = (self.numbers[f"{port}.{name}"] for name in ("Tx_Data", "Tx_Clock"))
        if ticks and not self.is_triggered:
            self.fmu.setClock([clock], [True])
        sends = self.fmu.getClock([clock])[0] if self.is_triggered else ticks
        return (self.fmu.getBinary([data])[0] or b"") if sends else b""

    def hear(self, port: str, content: bytes) -> None:
        self.fmu.setClock([self.numbers[f"{port}.Rx_Clock"]], [True])
        self.fmu.setBinary([self.numbers[f"{port}.Rx_Data"]], [content])

    def end_event(self, time: float) -> None:
        self.fmu.updateDiscreteStates()
        for port in self.ports if not self.is_triggered else ():
            interval, qualifier = (ctypes.c_double * 1)(), (ctypes.c_int * 1)()
            clock = (ctypes.c_uint32 * 1)(self.numbers[f"{port}.Tx_Clock"])
            self.fmu.getIntervalDecimal(clock, interval, qualifier)
            if qualifier[0] == _CHANGED:
                self.dues[port] = time + interval[0]
            elif qualifier[0] == _NOT_YET_KNOWN:
                self.dues[port] = inf
        self.fmu.enterStepMode()

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


Place = tuple[str, str]
"""A port: name of the node, and of its network."""


class Network:
    """Steps FMUs by name to their ticks, and carries what a port sends to the port that it is linked with.

    ``events`` lists time, node and whether its clock ticked; ``taps`` time, sender and operations.
    """

    def __init__(self, nodes: Mapping[str, FmuNode], links: Sequence[tuple[Place, Place]], step: float) -> None:
        self.nodes, self.time, self._step = nodes, 0.0, step
        self._peer = {first: second for a, b in links for first, second in ((a, b), (b, a))}
        self.events: list[tuple[float, str, bool]] = []
        self.taps: list[tuple[float, Place, bytes]] = []

    def run(self, stop: float) -> None:
        while self.time < stop - ROUND_OFF:
            grid = self._step * (floor(self.time / self._step + ROUND_OFF) + 1)
            target = max(min(grid, stop, *(node.due for node in self.nodes.values())), self.time)
            if target > self.time:
                for node in self.nodes.values():
                    node.step(self.time, target)
            self.time = target
            self._event()

    def _event(self) -> None:
        """All ticks of this time: first everything is sent, then heard."""
        active = {name for name, node in self.nodes.items() if node.needs_event or node.due <= self.time + 1e-12}
        for name in active:
            self.nodes[name].fmu.enterEventMode()
        carried: list[tuple[Place, bytes]] = []
        for name in sorted(active):
            node = self.nodes[name]
            ticking = [port for port in node.ports if node.is_triggered or node.dues[port] <= self.time + 1e-12]
            self.events.append((self.time, name, bool(ticking)))
            for port in ticking:
                node.dues[port] = inf
                if content := node.sent(port, ticks=True):
                    self.taps.append((self.time, (name, port), content))
                    carried.append((self._peer[name, port], content))
        for (name, port), content in carried:
            if name not in active:
                active.add(name)
                self.events.append((self.time, name, False))
                self.nodes[name].fmu.enterEventMode()
            self.nodes[name].hear(port, content)
        for name in active:
            self.nodes[name].end_event(self.time)
            self.nodes[name].needs_event = False

    def sent_by(self, place: Place) -> list[Frame]:
        """The frames that a port has sent, with their times."""
        return [
            frame for time, sender, content in self.taps if sender == place for frame in frames_in(content, time)
        ]

    def heard_by(self, place: Place) -> list[Frame]:
        return self.sent_by(self._peer[place])


class Sender:
    """Sends ``frames(k)`` at cycle k, each at ``period`` [s], and keeps what it hears as (time, operations)."""

    def __init__(self, frames: Callable[[int, float], Sequence[Frame]], cycles: int, period: float) -> None:
        self.frames, self._cycles, self._period, self._cycle = frames, cycles, period, 0
        self.due, self.heard, self.sent = 0.5 * period, list[tuple[float, bytes]](), list[tuple[float, Frame]]()

    def step(self, time: float, end: float) -> None:
        """Nothing happens between events."""

    def event(self, time: float, heard: Sequence[bytes], ticks: bool) -> bytes:
        self.heard += [(time, content) for content in heard]
        if not ticks:
            return b""
        frames = self.frames(self._cycle, time)
        self.sent += [(time, frame) for frame in frames]
        self._cycle += 1
        self.due = (0.5 + self._cycle) * self._period if self._cycle < self._cycles else inf
        return b"".join(map(transmit, frames))


class Master:
    """Links an FMU and a sender directly; ``confirms`` says that frames arrived, as a bus does.

    ``events`` lists the times of the FMU's events, and whether its clock ticked.
    """

    def __init__(self, ecu: FmuNode, sender: Sender, step: float = 0.01, confirms: bool = False) -> None:
        self.ecu, self.sender, self.time, self._step, self._confirms = ecu, sender, 0.0, step, confirms
        self.split: Callable[[bytes], list[bytes]] = lambda content: [content]
        self.events: list[tuple[float, bool]] = []
        self._back: list[bytes] = []

    def run(self, stop: float, lag: float = 0.0) -> None:
        """Go on to ``stop`` [s]; ticks of the FMU come ``lag`` [s] late."""
        while self.time < stop - ROUND_OFF:
            grid = self._step * (round(self.time / self._step) + 1)
            grid = grid - self._step if grid - self._step > self.time + ROUND_OFF else grid
            target = min(self.ecu.due + lag, self.sender.due, grid, stop)
            if target > self.time:
                self.ecu.step(self.time, target)
            self.time = max(target, self.time)
            ticks = self.ecu.due + lag <= self.time + 1e-12
            sends = self.sender.due <= self.time + 1e-12
            content = self.sender.event(self.time, [], sends) if sends else b""
            heard = [*self._back, *(self.split(content) if content else [])]
            self._back = []
            if ticks or heard or self.ecu.needs_event:
                self.events.append((self.time, ticks or self.ecu.needs_event))
                answer = self.ecu.event(self.time, heard, ticks)
                if answer:
                    self.sender.event(self.time, [answer], False)
                    if self._confirms:
                        sent = frames_in(answer, self.time)
                        back = (operation(CONFIRM, frame.identifier.to_bytes(4, "little")) for frame in sent)
                        self._back = [b"".join(back)] if sent else []
