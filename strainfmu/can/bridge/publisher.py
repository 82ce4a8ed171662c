"""Results as UDP datagrams of JSON, for displays; those that cannot be sent at once are dropped and counted."""

from __future__ import annotations

import json
import re
import socket
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from strainfmu.can.cycle.bus_state import BusState
from strainfmu.can.cycle.frame_account import FrameAccount
from strainfmu.can.cycle.quality import Quality
from strainfmu.can.cycle.result import CycleResult
from strainfmu.cosim.step import ENVELOPE_SCORE, health_name
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.estimator.health import HealthState
from strainfmu.estimator.inverse_map import COEFFICIENT_NAMES

LAYOUT_PERIOD = 1.0
"""Period of the datagrams with the positions of the gauges [s]: the longest wait of a new display."""

_LIMIT = re.compile(r"OUTSIDE above (\S+)")
_PLACE = re.compile(r"Strain of gauge (.+) at x = (\S+) m(?:, roll angle (\S+) deg)?")


@dataclass(frozen=True)
class GaugePosition:
    """Position of a gauge: ``x`` [m] aft of the nose tip, ``roll_angle`` [deg]; None where it is not known."""

    name: str
    x: float | None = None
    roll_angle: float | None = None


def gauge_positions(fmu: Path) -> tuple[GaugePosition, ...]:
    """Return the positions of the gauges of an estimator FMU, from the descriptions of its inputs.

    Raises
    ------
    InputError
        The FMU is missing, damaged, or no estimator.
    """
    from strainfmu.cosim.fmu_step import gauge_names_of
    from strainfmu.cosim.instance import read_description

    found = {}
    for variable in read_description(fmu).modelVariables:
        match = _PLACE.match(variable.description or "")
        if match:
            angle = None if match[3] is None else float(match[3])
            found[match[1]] = GaugePosition(match[1], float(match[2]), angle)
    return tuple(found.get(name, GaugePosition(name)) for name in gauge_names_of(fmu))


def envelope_score_limit(fmu: Path) -> float | None:
    """Return the envelope score above which an estimator FMU says OUTSIDE, None if it states none.

    Raises
    ------
    InputError
        The FMU is missing or damaged.
    """
    from strainfmu.cosim.instance import read_description

    for variable in read_description(fmu).modelVariables:
        match = _LIMIT.search(variable.description or "")
        if variable.name == ENVELOPE_SCORE and match:
            return _finite(float(match[1]))
    return None


def health_text(result: CycleResult, score_limit: float | None) -> str | None:
    """Return what is outside in a result of health OUTSIDE, None of others.

    The state alone does not tell. A score above its limit shows that the coefficients are outside; below it, it is
    the flow.
    """
    if result.health != HealthState.OUTSIDE:
        return None
    if score_limit is None or not isfinite(result.envelope_score):
        return "outside what the map covers"
    if result.envelope_score > score_limit:
        return "the coefficients are outside what the map covers"
    if isfinite(result.mach_number) or isfinite(result.altitude):
        return "dynamic pressure, Mach number or altitude is outside the map's range, or they do not agree"
    return "the dynamic pressure is outside the map's range"


def parsed_address(text: str, option: str) -> tuple[str, int]:
    """Return host and port of "host:port".

    Raises
    ------
    InputError
        The text has another form.
    """
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or not 0 <= int(port) < 65536:
        raise InputError(f"{option}: expected HOST:PORT such as 127.0.0.1:9870, got '{text}'")
    return host.strip("[]"), int(port)


class Publisher:
    """Sends every result, or at most ``rate`` per second; a change of quality is sent at once.

    Parameters
    ----------
    address : host and port.
    gauges : n_d positions, order of the strains.
    account, bus_state : return the present account and state.
    score_limit : envelope score above which the estimator says OUTSIDE, None if it is not known.

    Raises
    ------
    StrainfmuError
        The host is not known.
    """

    def __init__(
        self,
        address: tuple[str, int],
        gauges: Sequence[GaugePosition],
        rate: float,
        account: Callable[[], FrameAccount],
        bus_state: Callable[[], BusState],
        score_limit: float | None = None,
    ) -> None:
        try:
            family, kind, protocol, _, target = socket.getaddrinfo(*address, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
        except OSError as error:
            raise StrainfmuError(f"--publish {address[0]}:{address[1]}: {error.strerror or error}") from error
        self._socket.setblocking(False)
        self._target = target
        self._gauges, self._period = tuple(gauges), 1.0 / rate
        self._account, self._bus_state = account, bus_state
        self._score_limit = score_limit
        self._next = self._next_layout = float("-inf")
        self._quality: Quality | None = None
        self.sent = self.dropped = 0

    def result(self, result: CycleResult) -> None:
        """Send a result, unless one was sent just before."""
        now = time.monotonic()
        if now < self._next and result.quality is self._quality:
            return
        self._quality, self._next = result.quality, now + self._period
        if now >= self._next_layout:
            self._next_layout = now + LAYOUT_PERIOD
            self._send({"layout": {"gauges": [asdict(gauge) for gauge in self._gauges]}})
        self._send(self._of_result(result))

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _of_result(self, result: CycleResult) -> dict[str, Any]:
        account = self._account()
        micro = [None if not isfinite(value) else round(1e6 * value, 3) for value in result.strain.tolist()]
        return {
            "timestamp": time.time(),
            "quality": int(result.quality),
            "quality_name": result.quality.name,
            "causes": [cause.name for cause in result.causes],
            "coefficients": _named(result.coefficients.tolist()),
            "sigma": _named(result.coefficients_std.tolist()),
            "strain_um_per_m": dict(zip((g.name for g in self._gauges), micro, strict=True)),
            "dynamic_pressure_Pa": _finite(result.dynamic_pressure),
            "mach_number": _finite(result.mach_number),
            "altitude_m": _finite(result.altitude),
            "age_ms": _finite(1e3 * result.age),
            "age_uncertainty_ms": _finite(1e3 * result.age_uncertainty),
            "health": result.health,
            "health_name": None if result.health is None else health_name(result.health),
            "health_text": health_text(result, self._score_limit),
            "chi_square": _finite(result.chi_square),
            "envelope_score": _finite(result.envelope_score),
            "envelope_score_limit": self._score_limit,
            "bus_state": self._bus_state().name,
            "account": {**dict(account.rows()), "not accounted for": account.unaccounted},
            "datagrams": {"sent": self.sent, "dropped": self.dropped},
        }

    def _send(self, content: dict[str, Any]) -> None:
        try:
            self._socket.sendto(json.dumps(content, separators=(",", ":")).encode(), self._target)
        except OSError:  # the system's buffer is full, the datagram is too long, or no one listens
            self.dropped += 1
            return
        self.sent += 1


def _named(values: Sequence[float]) -> dict[str, float | None]:
    return {name: _finite(value) for name, value in zip(COEFFICIENT_NAMES, values, strict=True)}


def _finite(value: float) -> float | None:
    """Return the number, None where JSON has none for it."""
    return value if isfinite(value) else None
