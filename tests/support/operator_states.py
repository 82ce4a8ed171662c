"""A bridge, a monitor and a sender as on a test range, brought into the states that an operator must tell apart.

Bridge and monitor are the installed commands, processes of their own; the sender is this process; udp_multicast
joins them. As a program it writes the pictures of the documentation:
``python tests/support/operator_states.py DEMO FOLDER``.
"""

import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from builder.pipeline.demonstration.bus_flight import private_port
from strainfmu.can.opening import BusSettings, open_bus
from strainfmu.can.options import BridgeOptions
from strainfmu.can.sender import send_flight
from strainfmu.can.setup import input_layout, stated_in
from strainfmu.can.strain_sources import FlownSample, plant_samples

CYCLE = 0.02
"""Period of the strain frames [s]: long enough for a busy host to be on time."""
GROUP = "239.74.163.12"
STATES = ("good", "suspect", "lost_frame", "bus_off", "gone")

_COMMAND = (sys.executable, "-c", "from strainfmu.cli.main import main; main()")
_ADDRESSES = re.compile(r"(http://\S+/): .*datagrams at (\S+);")
_BUS_OFF = 0x40
_FREQUENT, _OTHERS = 24, 72
"""Colours of a picture's palette: the most frequent ones, and those that stand for all others."""
_BIAS = 1e-5
"""Error of the suspect gauge [m/m]."""


class TestRange:
    """What happens on the range; every attribute may be changed at any time.

    Attributes
    ----------
    url : of the page.
    bias : (n_d,) added to the strains [m/m].
    lost : number of the strain frame, from 0, that does not arrive; None for none.
    is_off : the bus controller reports bus off, again and again.
    """

    __test__ = False

    def __init__(self, n_gauges: int, keys: Sequence[int]) -> None:
        self.url = ""
        self.bias = np.zeros(n_gauges)
        self.lost: int | None = None
        self.is_off = False
        self.bridge: subprocess.Popen[str] | None = None
        self._keys = keys

    def enter(self, state: str) -> None:
        """Bring about one of STATES; each ends the one before."""
        self.bias[:], self.lost, self.is_off = 0.0, None, False
        if state == "suspect":
            self.bias[min(4, len(self.bias) - 1)] = _BIAS
        elif state == "lost_frame":
            self.lost = len(self._keys) - 1
        elif state == "bus_off":
            self.is_off = True
        elif state == "gone" and self.bridge is not None:
            self.bridge.send_signal(signal.SIGTERM)
            self.bridge.communicate(timeout=20.0)

    def flown(self, samples: Sequence[FlownSample]) -> Iterator[FlownSample]:
        """Yield ``samples`` to and fro for ever, with the bias."""
        for sample in cycle([*samples, *samples[-2:0:-1]]):
            yield replace(sample, strain=sample.strain + self.bias)

    def message(self, message: Any) -> Any:
        """Return what comes of a message of the sender on the bus, None if nothing does."""
        import can

        if self.is_off:
            # The identifier's bits and eight bytes, as SocketCAN reports the controller's state.
            return can.Message(
                arbitration_id=_BUS_OFF, data=bytes(8), is_error_frame=True, is_extended_id=False, check=True
            )
        is_lost = self.lost is not None and message.arbitration_id == self._keys[self.lost]
        return None if is_lost else message


class _Line:
    """The sender's end of the bus, with the faults of the moment."""

    def __init__(self, bus: Any, state: TestRange) -> None:
        self._bus, self._state = bus, state

    def send(self, message: Any) -> None:
        arriving = self._state.message(message)
        if arriving is not None:
            self._bus.send(arriving)


@contextmanager
def running_range(fmu: Path, samples: Sequence[FlownSample], record: Path | None = None) -> Iterator[TestRange]:
    """Run monitor, bridge and sender until the context is left."""
    options = BridgeOptions(interface="udp_multicast", channel=GROUP, cycle_time=CYCLE)
    names = stated_in(fmu)[0]
    layout, _ = input_layout(options, names)
    state = TestRange(len(names), [frame.layout.identifier for frame in layout.strain_frames])
    port = private_port()
    with ExitStack() as stack:
        monitor = stack.enter_context(_process("monitor", "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0"))
        address = _ADDRESSES.match(_first_line(monitor))
        assert address is not None
        state.url = address[1]
        recording = [] if record is None else ["--record", str(record)]
        bus_options = ("--interface", "udp_multicast", "--channel", GROUP, "--bus-option", f"port={port}")
        entries = ("--set", f"input.cycle_time_ms={1e3 * CYCLE:g}", "--set", f"page.publish={address[2]}")
        entries += ("--set", "trust.restart=accept")  # the flight is repeated
        state.bridge = stack.enter_context(_process("bridge", str(fmu), *bus_options, *entries, *recording))
        assert _first_line(state.bridge)
        bus = open_bus(BusSettings(interface="udp_multicast", channel=GROUP, options={"port": port}))
        stack.callback(bus.shutdown)
        stopped = threading.Event()
        sender = threading.Thread(
            target=send_flight,
            args=(_Line(bus, state), layout),
            kwargs={"samples": state.flown(samples), "stopped": stopped.is_set},
            daemon=True,
        )
        sender.start()
        stack.callback(sender.join, 10.0)
        stack.callback(stopped.set)
        yield state


@contextmanager
def _process(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a command of the product; whatever happens, it does not outlive this."""
    process = subprocess.Popen(
        [*_COMMAND, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
            try:
                process.communicate(timeout=20.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()


def _first_line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline()


def demo_samples(demo: Path) -> list[FlownSample]:
    """Return the loaded part of the manoeuvre of a finished demonstration."""
    n_gauges = len(stated_in(demo / "estimator.fmu")[0])
    with plant_samples(demo / "plant.fmu", n_gauges, CYCLE, 10.0) as samples:
        return list(samples)[round(2.0 / CYCLE) : round(8.0 / CYCLE)]


def make_pictures(demo: Path, folder: Path) -> None:
    """Write a picture of each state as PNG with a palette."""
    from chromium import Browser
    from clipping import set_width

    times = {"good": 40.0, "suspect": 9.0, "lost_frame": 5.0, "bus_off": 2.6, "gone": 6.0}
    with tempfile.TemporaryDirectory() as scratch:
        record = Path(scratch) / "run.blf"
        browser = Browser(Path(scratch) / "profile", "about:blank")
        with suppress(PermissionError, AttributeError):
            # Drawing the page must not disturb the run that it shows; the browser keeps its own priority.
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        with running_range(demo / "estimator.fmu", demo_samples(demo), record) as state:
            browser.call("Page.navigate", url=state.url)
            try:
                for name in STATES:
                    if name in ("lost_frame", "gone"):  # a while without faults between two of them
                        state.enter("good")
                        time.sleep(8.0)
                    set_width(browser, 1280, 900)
                    state.enter(name)
                    time.sleep(times[name])
                    _picture(browser, folder / f"monitor_{name}.png")
            finally:
                browser.close()
    for path in folder.glob("monitor_*.png"):
        _save_with_palette(path)


def _picture(browser: Any, path: Path) -> None:
    """Write the whole page."""
    from clipping import set_width

    set_width(browser, 1280, int(browser.value("document.documentElement.scrollHeight")))
    time.sleep(0.4)
    browser.screenshot(path)


def _save_with_palette(path: Path) -> None:
    """Write a picture again with a palette, at a third of its size.

    The most frequent colours stay as they are; the others, shades of edges, become the nearest of the palette.
    """
    from PIL import Image

    image = Image.open(path).convert("RGB")
    pixels = np.asarray(image).astype(np.int64) @ np.array([1 << 16, 1 << 8, 1])
    colours, index, counts = np.unique(pixels, return_inverse=True, return_counts=True)
    parts = np.stack((colours >> 16, colours >> 8 & 255, colours & 255), axis=-1)
    chosen = np.argsort(-counts)[:_FREQUENT].tolist()
    distance = np.min([((parts - parts[number]) ** 2).sum(axis=1) for number in chosen], axis=0)
    for _ in range(_OTHERS):  # whichever is farthest from all so far, so that no hue is lost
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, ((parts - parts[chosen[-1]]) ** 2).sum(axis=1))
    palette = parts[chosen]
    nearest = np.array([np.argmin(((palette - part) ** 2).sum(axis=1)) for part in parts], dtype=np.uint8)
    written = Image.fromarray(nearest[index].reshape(pixels.shape), mode="P")
    written.putpalette(palette.astype(np.uint8).ravel().tolist())
    written.save(path, optimize=True)


if __name__ == "__main__":
    make_pictures(Path(sys.argv[1]), Path(sys.argv[2]))
