"""Strain frames out and result frames in, with python-can and cantools alone: what a node of yours has to do.

    strainfmu dbc map.h5 -o strains.dbc
    python can_cantools_example.py strains.dbc udp_multicast 239.74.163.2 43200

Nothing of strainfmu is imported. The frames are those of profile fd64; docs/reference/can.md describes every byte.
"""

import binascii
import math
import random
import sys
import time

import can
import cantools


def protect(data, data_id, counter):
    """E2E profile 5: counter in byte 2, CRC-16/CCITT-FALSE over bytes 2.. and the DataID in bytes 0 and 1."""
    data = bytearray(data)
    data[2] = counter % 256
    crc = binascii.crc_hqx(bytes(data[2:]) + data_id.to_bytes(2, "little"), 0xFFFF)
    data[:2] = crc.to_bytes(2, "little")
    return bytes(data)


def is_intact(data, data_id):
    """Tell whether the CRC of a received frame fits."""
    return protect(data, data_id, data[2])[:2] == data[:2]


def data_id_of(message):
    """The DataID is an attribute of the DBC file."""
    return message.dbc.attributes["E2EDataID"].value


def state_of(session, heard, seconds):
    """Return the numbers of SenderState: ``heard`` is a result's counter and sample time, and when it came [s]."""
    if heard is None:
        return {"Session": session, "HeardCounter": 0, "HeardTime": 2**32 - 1, "HeardDelay": 6553.5}
    counter, sampled, when = heard
    delay = min(max(math.floor(1e4 * (seconds - when)) / 10, 0.0), 6553.4)
    return {"Session": session, "HeardCounter": counter, "HeardTime": sampled, "HeardDelay": delay}


def strain_frames(database, cycle, seconds, strain_of, dynamic_pressure, session=1, heard=None):
    """Return the frames of one cycle: state, dynamic pressure, then strains [um/m], all with one sample time.

    ``session`` is higher at each start. The frame Navigation is optional: a node without it does not send it.
    """
    sent = [m for m in database.messages if "StrainSender" in m.senders and m.name != "Navigation"]
    order = ["SenderState", "DynamicPressure"]
    frames = []
    for message in sorted(sent, key=lambda m: order.index(m.name) if m.name in order else len(order)):
        values = state_of(session, heard, seconds) if message.name == "SenderState" else {}
        for signal in message.signals:
            if signal.name in values:
                continue
            if signal.name == "SampleTime":
                values[signal.name] = int(seconds * 1e6) % 2**32
            elif signal.name == "Configuration":
                values[signal.name] = signal.raw_initial
            elif signal.name == "DynamicPressure":
                values[signal.name] = dynamic_pressure
            elif signal.unit == "um/m":
                values[signal.name] = strain_of(signal.name)
            else:
                values[signal.name] = 0
        data = protect(message.encode(values), data_id_of(message), cycle)
        frames.append(
            can.Message(
                arbitration_id=message.frame_id,
                data=data,
                is_extended_id=message.is_extended_frame,
                is_fd=message.is_fd,
                bitrate_switch=message.is_fd,
                check=True,
            )
        )
    return frames


def main(path, interface, channel, port, cycles=200):
    """Send strains for two seconds and print what comes back."""
    database = cantools.database.load_file(path)
    result = database.get_message_by_name("LoadEstimate")
    options = {"port": int(port), "hop_limit": 0} if interface == "udp_multicast" else {}
    answers, heard, session = {}, None, int(time.time()) % 2**16
    with can.Bus(interface=interface, channel=channel, **options) as bus:
        start = time.monotonic()
        for cycle in range(cycles):
            noise = random.Random(cycle)

            def strain_of(name, cycle=cycle, noise=noise):
                return 50.0 * math.sin(0.05 * cycle + len(name)) + 100.0 + noise.gauss(0.0, 1.0)

            now = time.monotonic() - start
            for frame in strain_frames(database, cycle, now, strain_of, 95.8e3, session, heard):
                bus.send(frame)
            while time.monotonic() < start + 0.01 * (cycle + 1):
                message = bus.recv(0.002)
                if message is None or message.arbitration_id != result.frame_id:
                    continue
                if is_intact(message.data, data_id_of(result)):
                    decoded = database.decode_message(message.arbitration_id, message.data)
                    answers[str(decoded["Quality"])] = answers.get(str(decoded["Quality"]), 0) + 1
                    if decoded["SampleTime"] != 2**32 - 1:
                        heard = decoded["E2E_Counter"], decoded["SampleTime"], time.monotonic() - start
    print(f"{cycles} cycles sent; answers by quality: {answers}")
    if answers:
        print({name: round(float(decoded[name]), 4) for name in ("C_A", "C_N", "C_Y", "M_P", "M_Y", "Age")})


if __name__ == "__main__":
    main(*sys.argv[1:])
