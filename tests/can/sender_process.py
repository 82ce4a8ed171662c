"""A sender of its own process: strains of fd64 over a bus at a rate, and what came back into a file.

    python sender_process.py CHANNEL PORT CYCLE_TIME INPUT OUT [flood]

INPUT holds ``names``, ``strain`` (n, n_d) [m/m] and ``pressure`` (n,) [Pa]. "flood" puts frames of unknown
identifiers and datagrams that are no frames between the cycles.
"""

from __future__ import annotations

import socket
import sys
import threading
import time

import can
import numpy as np

from strainfmu.can.bus import BusSettings, open_bus
from strainfmu.can.frame import to_message
from strainfmu.can.profiles import profile_layout
from strainfmu.can.strain_encoder import StrainEncoder

FOREIGN = 20
RESULT = 0x380


def listen(bus: can.BusABC, received: list[bytes], stop: threading.Event) -> None:
    """Keep the data of result frames; datagrams that are no frames end python-can's own Notifier."""
    while not stop.is_set():
        try:
            message = bus.recv(0.1)
        except can.CanError:
            continue
        if message is not None and message.arbitration_id == RESULT:
            received.append(bytes(message.data))


def main(channel: str, port: str, period: str, source: str, out: str, *mode: str) -> None:
    """Send, and write the results that were received."""
    given = np.load(source)
    cycle_time = float(period)
    encoder = StrainEncoder(profile_layout("fd64", given["names"].tolist(), cycle_time))
    cycles = enumerate(zip(given["strain"], given["pressure"].tolist(), strict=True))
    frames = [[to_message(f) for f in encoder.encode(d, q, k, k * cycle_time)] for k, (d, q) in cycles]
    settings = BusSettings("udp_multicast", channel, {"port": int(port)})
    bus, listener = open_bus(settings), open_bus(settings)
    received: list[bytes] = []
    stop = threading.Event()
    thread = threading.Thread(target=listen, args=(listener, received, stop))
    thread.start()
    time.sleep(0.3)
    raw = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    raw.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    start = time.monotonic()
    for k, messages in enumerate(frames):
        for message in messages:
            bus.send(message)
        if mode and k % 2 == 0:
            raw.sendto(b"no frame at all", (channel, int(port)))
            for i in range(FOREIGN):
                bus.send(can.Message(arbitration_id=0x500 + i, data=bytes(8), is_extended_id=False))
        wait = start + (k + 1) * cycle_time - time.monotonic()
        if wait > 0:
            time.sleep(wait)
    time.sleep(1.0)
    stop.set()
    thread.join()
    raw.close()
    bus.shutdown()
    listener.shutdown()
    np.savez(out, results=np.frombuffer(b"".join(received), dtype=np.uint8).reshape(-1, 64))


if __name__ == "__main__":
    main(*sys.argv[1:])
