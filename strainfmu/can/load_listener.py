"""Loads from a bus in a program of one's own: a listener for python-can's Notifier."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strainfmu.can.bus_file import read_bus
from strainfmu.can.listener import Taps
from strainfmu.can.options import BridgeOptions
from strainfmu.can.setup import live_listener
from strainfmu.errors import InputError

if TYPE_CHECKING:
    from strainfmu.can.machine import Result
    from strainfmu.can.quality import FrameAccount
    from strainfmu.estimator.estimator import Estimator

_LONGEST_WAIT = 0.1


class LoadListener:
    """Turns the strain frames of a bus into loads, in a thread or with asyncio.

        listener = strainfmu.LoadListener(strainfmu.load("map.h5"), "bus.toml", on_result=print, bus=bus)
        notifier = can.Notifier(bus, [listener])

    ``notifier.stop()`` ends it, as does :meth:`stop`.

    Parameters
    ----------
    estimator : of :func:`strainfmu.load`, or the file of an inverse map or of an FMU.
    bus_file : bus.toml; of its tables input, results, clock, trust and zeros count.
    on_result : called with every result, which must not block.
    bus : python-can's, on which results are sent; without it none are, and a sender that is started again waits
        for :meth:`confirm`.
    loop : asyncio's, equal to the Notifier's; None for a thread of its own.

    Attributes
    ----------
    last : latest result, None before the first.

    Raises
    ------
    InputError
        A file or an entry is wrong, or does not fit the estimator.
    """

    def __init__(
        self,
        estimator: Estimator | str | Path,
        bus_file: str | Path,
        *,
        on_result: Callable[[Result], None] | None = None,
        bus: Any = None,
        loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        from strainfmu.cosim.estimators.source import MapStep, open_step
        from strainfmu.cosim.estimators.zeros_file import load_zeros

        options = read_bus(Path(bus_file)).options(BridgeOptions(interface="", channel=""))
        if options.tare is not None:
            raise InputError(f"{bus_file}: tare.map: expected with 'strainfmu bridge' alone")
        self._lock, self._stack, self._stopped = threading.RLock(), ExitStack(), threading.Event()
        step: Any
        if isinstance(estimator, str | Path):
            ready = self._stack.enter_context(open_step(Path(estimator), options.zeros))
            step, names = ready.step, ready.gauge_names
        else:
            inverse_map = estimator.inverse_map
            step, names = MapStep(estimator), tuple(inverse_map.gauge_names[: inverse_map.n_strain_gauges])
            if options.zeros is not None:
                step.set_zeros(load_zeros(options.zeros, names))
        taps = Taps(clock=time.monotonic, on_result=on_result)
        self._listener, _, _ = live_listener(self._stack, step, options, names, taps, is_answered=bus is not None)
        self._machine = self._listener.machine
        self._listener.use(bus)
        self._loop = loop
        if loop is None:
            threading.Thread(target=self._run, name="loads", daemon=True).start()
        else:
            loop.call_soon(self._look)

    def __call__(self, message: Any) -> None:
        """Process a message of python-can."""
        with self._lock:
            if not self._stopped.is_set():
                self._listener.take(message, time.monotonic())

    on_message_received = __call__

    @property
    def account(self) -> FrameAccount:
        """Every frame so far, in exactly one class."""
        with self._lock:
            return self._machine.account

    @property
    def last(self) -> Result | None:
        """The latest result."""
        return self._listener.last

    def confirm(self) -> None:
        """Confirm the sender and its present delay, which you have checked."""
        with self._lock:
            self._machine.confirm()

    def stop(self) -> None:
        """Stop: no more results come."""
        with self._lock:
            if not self._stopped.is_set():
                self._stopped.set()
                self._machine.finish(self._listener.known)
                self._stack.close()

    def _run(self) -> None:
        """Look at the time in a thread."""
        while not self._stopped.wait(self._advance()):
            pass

    def _look(self) -> None:
        """Look at the time in a loop."""
        if not self._stopped.is_set() and self._loop is not None:
            self._loop.call_later(self._advance(), self._look)

    def _advance(self) -> float:
        """Answer what is due; return the time until something may be again [s]."""
        with self._lock:
            now = time.monotonic()
            if not self._stopped.is_set():
                self._listener.advance(now)
            due = min(self._machine.next_event, self._listener.next_status) - time.monotonic()
        return min(max(due, 1e-3), _LONGEST_WAIT)
