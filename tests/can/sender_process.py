"""A sender of its own process: strains of fd64 over a bus at a rate, and what came back into a file.

    python sender_process.py CHANNEL PORT CYCLE_TIME INPUT OUT [flood]

INPUT holds ``names``, ``strain`` (n, n_d) [m/m] and ``pressure`` (n,) [Pa]. "flood" puts frames of unknown
identifiers and datagrams that are no frames between the cycles. The first cycle is sent once the bridge answers,
and the sender ends once the bridge has answered what was sent. One thread: on two cores, shared with the bridge,
a second one would slow down what is measured. OUT holds ``results`` (n, 64), ``late`` (n,), by how much the end of
each cycle was late [s], and ``dropped``, the number of datagrams that the system dropped ahead of this process.
"""

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
from strainfmu.can.opening import BusSettings, kernel_drops, open_bus
from strainfmu.can.profiles import Identifiers, profile_layout
from strainfmu.can.result_frames import result_layouts
from strainfmu.can.signals import SignalPlan

FOREIGN = 20
RESULT, NONE_ANSWERED = 0x380, 2**32 - 1
PATIENCE = 120.0
"""Time for which the bridge is waited for [s]."""
SILENT = 5
"""Results of silence in a row behind which the bridge has read all that was sent."""
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


def results_in(heard: list[bytes]) -> list[bytes]:
    """Return the data of the result frames in these datagrams."""
    messages = [unpack_message(datagram) for datagram in heard]
    return [bytes(message.data) for message in messages if message.arbitration_id == RESULT]


def wait_for_silence(ears: socket.socket, heard: list[bytes], cycle_time: float) -> None:
    """Hear until the latest results answer no cycle, since none was sent or all were answered."""
    plan = SignalPlan(result_layouts("fd", Identifiers(), cycle_time)[0])
    of_cycle = [signal.name for signal in plan.signals].index("SampleTime")
    begin, end = len(heard), time.monotonic() + PATIENCE
    while time.monotonic() < end:
        hear(ears, heard)
        latest = results_in(heard[begin:][-SILENT:])
        if len(latest) == SILENT and all(plan.raw(data)[of_cycle] == NONE_ANSWERED for data in latest):
            return
        time.sleep(cycle_time)
    raise TimeoutError(f"no answer of the bridge within {PATIENCE:g} s")


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
    wait_for_silence(ears, heard, cycle_time)
    late = np.zeros(len(frames))
    start, busy = time.monotonic(), time.process_time()
    for k, messages in enumerate(frames):
        for message in messages:
            bus.send(message)
        if mode and k % 2 == 0:
            raw.sendto(b"no frame at all", (channel, int(port)))
            for i in range(FOREIGN):
                bus.send(can.Message(arbitration_id=0x500 + i, data=bytes(8), is_extended_id=False))
        late[k] = time.monotonic() - start - k * cycle_time
        hear(ears, heard)
        wait = start + (k + 1) * cycle_time - time.monotonic()
        if wait > 0:
            time.sleep(wait)
    print(f"sent for {time.monotonic() - start:.2f} s; {time.process_time() - busy:.2f} s of processor time")
    wait_for_silence(ears, heard, cycle_time)
    dropped = kernel_drops(bus) or 0
    ears.close()
    raw.close()
    bus.shutdown()
    received = np.frombuffer(b"".join(results_in(heard)), dtype=np.uint8).reshape(-1, 64)
    np.savez(out, results=received, late=late, dropped=dropped)


if __name__ == "__main__":
    main(*sys.argv[1:])
