"""Sender and bridge as two processes over udp_multicast: the end of ``strainfmu demo --can``."""

import json
import os
import secrets
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from strainfmu.can.opening import MULTICAST_ADVICE, BusSettings, open_bus, shut_down
from strainfmu.can.profiles import SECURED_PROFILE
from strainfmu.can.sender import Score
from strainfmu.errors import StrainfmuError
from strainfmu.files import write_bytes_atomically

GROUP = "239.74.163.9"
"""Multicast group of the demonstration, of those free for use within an organisation (RFC 2365)."""

FIRST_PORT, PORTS = 43_300, 500
CYCLE_TIME = 0.01

_COMMAND = (sys.executable, "-c", "from strainfmu.cli.main import main; main()")
_PATIENCE = 300.0


@dataclass(frozen=True)
class BusFlight:
    """Output of the two processes: the sender's score and lines, and the bridge's summary."""

    score: Score
    sender: str
    bridge: str


def fly_over_bus(folder: Path, duration: float, is_authenticated: bool = False) -> BusFlight:
    """Fly the plant of a finished demonstration for ``duration`` [s] at 100 Hz against a bridge of its estimator.

    Frames that are authenticated are of profile fd64-sec, with a key made for this flight.

    Raises
    ------
    StrainfmuError
        There is no route for multicast, or a process failed; the message holds its own.
    """
    port = private_port()
    check_multicast(port)
    bus = ("--interface", "udp_multicast", "--channel", GROUP, "--bus-option", f"port={port}")
    cycle: tuple[str, ...] = ("--set", f"input.cycle_time_ms={1e3 * CYCLE_TIME:g}")
    with tempfile.TemporaryDirectory(prefix="strainfmu_") as temporary:
        if is_authenticated:
            key = Path(temporary) / "key.txt"
            write_bytes_atomically(key, secrets.token_hex(16).encode(), is_private=True)
            cycle = (*cycle, "--profile", SECURED_PROFILE, "--set", f"input.key={key}")
        report = Path(temporary) / "score.json"
        # Wide enough for the tables on any terminal.
        environment = {**os.environ, "COLUMNS": "120"}
        with _running([*_COMMAND, "bridge", str(folder / "estimator.fmu"), *bus, *cycle], environment) as bridge:
            sender = subprocess.run(
                [
                    *(*_COMMAND, "send", "--map", str(folder / "map.h5"), "--plant", str(folder / "plant.fmu")),
                    *(*bus, *cycle, "--duration", f"{duration:g}", "--report", str(report)),
                ],
                capture_output=True,
                text=True,
                env=environment,
                timeout=duration + 2.0 * _PATIENCE,
                check=False,
            )
            bridge.send_signal(signal.SIGTERM)
            summary, errors = (text.decode() for text in bridge.communicate(timeout=_PATIENCE))
        for name, code, text in (
            ("sender", sender.returncode, sender.stderr),
            ("bridge", bridge.returncode, errors),
        ):
            if code:
                raise StrainfmuError(f"CAN {name}: ended with exit code {code}: {text.strip() or 'no message'}")
        score = Score(**json.loads(report.read_text()))
    return BusFlight(score, sender.stdout, summary)


@contextmanager
def _running(command: list[str], environment: dict[str, str]) -> Iterator[subprocess.Popen[bytes]]:
    """Start the bridge and wait for its first line; whatever happens, it does not outlive this."""
    # Without a buffer, for ``communicate`` would not find there what came together with the first line.
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0, env=environment)
    try:
        assert process.stdout is not None
        if not process.stdout.readline():
            errors = process.communicate(timeout=_PATIENCE)[1].decode()
            raise StrainfmuError(f"CAN bridge: did not start: {errors.strip()}")
        yield process
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()


def private_port() -> int:
    """Return a port that is unlikely to be in use by another demonstration on this host."""
    return FIRST_PORT + os.getpid() % PORTS


def check_multicast(port: int) -> None:
    """Send one frame to the group, to check the route before the flight.

    Raises
    ------
    StrainfmuError
        There is none; the message states a remedy.
    """
    import can

    bus = open_bus(BusSettings(interface="udp_multicast", channel=GROUP, options={"port": port}))
    try:
        bus.send(can.Message(arbitration_id=0x7FF, is_extended_id=False))
    except (can.CanError, OSError) as error:
        no_route = "no route for multicast on this host, so sender and bridge cannot meet"
        raise StrainfmuError(f"{no_route}: {MULTICAST_ADVICE}") from error
    finally:
        shut_down(bus)
