"""A sender of its own process: strains of fd64 over a bus at a rate, and what came back into a file.

    python sender_process.py CHANNEL PORT CYCLE_TIME INPUT OUT [flood]

INPUT holds ``names``, ``strain`` (n, n_d) [m/m] and ``pressure`` (n,) [Pa]. "flood" puts frames of unknown
identifiers and datagrams that are no frames between the cycles. One thread: on two cores, shared with the bridge,
a second one would slow down what is measured.
"""

from __future__ import annotations

import gc
import os
import socket
import sys
import time

import can
import numpy as np
from can.interfaces.udp_multicast.utils import unpack_message

from strainfmu.can.encoder import StrainEncoder
from strainfmu.can.frame import to_message
from strainfmu.can.opening import BusSettings, open_bus
from strainfmu.can.profiles import profile_layout

FOREIGN = 20
RESULT = 0x380
RESULT_INSIDE = b"arbitration_id\xcd\x03\x80"
"""The identifier in a datagram of python-can: its name, then msgpack's 16 bit number."""


def hear(ears: socket.socket, heard: list[bytes]) -> None:
    """Keep the datagrams of result frames that have come; to unpack them is for later."""
    while True:
        try:
            datagram = ears.recv(4096, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return
        if RESULT_INSIDE in datagram:
            heard.append(datagram)


def main(channel: str, port: str, period: str, source: str, out: str, *mode: str) -> None:
    """Send, and write the results that were received."""
    given = np.load(source)
    cycle_time = float(period)
    encoder = StrainEncoder(profile_layout("fd64", given["names"].tolist(), cycle_time))
    cycles = enumerate(zip(given["strain"], given["pressure"].tolist(), strict=True))
    frames = [
        [to_message(f) for f in encoder.encode(d, q, cycle=k, sample_time=k * cycle_time)] for k, (d, q) in cycles
    ]
    settings = BusSettings(interface="udp_multicast", channel=channel, options={"port": int(port)})
    bus = open_bus(settings)
    ears = socket.socket(fileno=os.dup(bus.fileno()))
    heard: list[bytes] = []
    gc.freeze()  # or the frames made ahead are looked through again and again
    raw = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    raw.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    start, busy = time.monotonic(), time.process_time()
    for k, messages in enumerate(frames):
        for message in messages:
            bus.send(message)
        if mode and k % 2 == 0:
            raw.sendto(b"no frame at all", (channel, int(port)))
            for i in range(FOREIGN):
                bus.send(can.Message(arbitration_id=0x500 + i, data=bytes(8), is_extended_id=False))
        hear(ears, heard)
        wait = start + (k + 1) * cycle_time - time.monotonic()
        if wait > 0:
            time.sleep(wait)
    print(f"sent for {time.monotonic() - start:.2f} s; {time.process_time() - busy:.2f} s of processor time")
    time.sleep(1.0)
    hear(ears, heard)
    ears.close()
    raw.close()
    bus.shutdown()
    messages = [unpack_message(datagram) for datagram in heard]
    received = b"".join(bytes(message.data) for message in messages if message.arbitration_id == RESULT)
    np.savez(out, results=np.frombuffer(received, dtype=np.uint8).reshape(-1, 64))


if __name__ == "__main__":
    main(*sys.argv[1:])
