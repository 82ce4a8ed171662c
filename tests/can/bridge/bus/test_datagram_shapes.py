"""Known shapes of datagrams: the same frames and datagrams as by unpacking and packing each."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgpack
import numpy as np
import pytest
from can.interfaces.udp_multicast.utils import pack_message

from strainfmu.can.bridge.bus.datagram_shapes import DatagramShapes
from strainfmu.can.wire.frame import Frame, to_message

pytestmark = pytest.mark.fast

KINDS = [
    Frame(identifier=0x301, data=bytes(64), is_fd=True, bitrate_switch=True),
    Frame(identifier=0x302, data=bytes(64), is_fd=True, bitrate_switch=True),
    Frame(identifier=0x302, data=bytes(64), is_fd=True),
    Frame(identifier=0x300, data=bytes(16), is_fd=True, bitrate_switch=True),
    Frame(identifier=0x7FF, data=bytes(8)),
    Frame(identifier=0x12345678, data=bytes(8), is_extended=True),
    Frame(identifier=0x12, data=b""),
]
HOSTILE = b"\xa9timestamp\xcb\xa4data\xc4\x08" + bytes(range(200, 240))
"""Data that look like the keys of the map."""


def packed(frame: Frame, **other: Any) -> bytes:
    content = msgpack.unpackb(pack_message(to_message(frame)))
    return bytes(msgpack.packb({**content, **other}))


def test_frames_and_datagrams_of_known_shapes_are_those_of_msgpack() -> None:
    shapes = DatagramShapes(msgpack.unpackb)
    for kind in KINDS:
        assert shapes.frame(packed(kind), 0.0) is None
        assert shapes.datagram(kind) is None
        shapes.learn(packed(kind), kind)
    random = np.random.default_rng(3)
    for turn in range(200):
        kind = KINDS[turn % len(KINDS)]
        data = (
            random.bytes(len(kind.data)) if turn % 2 else HOSTILE[: len(kind.data)].ljust(len(kind.data), b"\xa4")
        )
        frame = replace(kind, data=data, time=float(turn))
        datagram = packed(frame, timestamp=float(random.normal()))
        assert shapes.frame(datagram, float(turn)) == frame
        assert shapes.datagram(frame) == packed(frame, timestamp=0.0)


@pytest.mark.parametrize(
    "other",
    [
        {"is_fd": False},
        {"arbitration_id": 0x303},
        {"bitrate_switch": False},
        {"error_state_indicator": True},
        {"is_error_frame": True},
        {"dlc": 12},
        {"timestamp": 0},
        {"channel": "can0"},
        {"data": bytes(63)},
        {"data": "x" * 64},
    ],
)
def test_a_datagram_that_differs_elsewhere_is_of_no_known_shape(other: dict[str, Any]) -> None:
    shapes = DatagramShapes(msgpack.unpackb)
    shapes.learn(packed(KINDS[0]), KINDS[0])
    assert shapes.frame(packed(KINDS[0]), 0.0) is not None
    assert shapes.frame(packed(KINDS[0], **other), 0.0) is None


def test_places_that_are_found_in_the_data_are_not_kept() -> None:
    """A map with the data ahead of the time stamp, which look like both keys."""
    frame = replace(KINDS[0], data=HOSTILE.ljust(64, b"\0"))
    content = msgpack.unpackb(packed(frame))
    turned = bytes(msgpack.packb(dict(reversed(content.items()))))
    shapes = DatagramShapes(msgpack.unpackb)
    shapes.learn(turned, frame)
    assert shapes.frame(turned, 0.0) is None


def test_shapes_without_number_do_not_fill_the_memory() -> None:
    shapes = DatagramShapes(msgpack.unpackb)
    kinds = [Frame(identifier=0x100 + number, data=bytes(8)) for number in range(100)]
    for kind in kinds:
        shapes.learn(packed(kind), kind)
    known = [kind for kind in kinds if shapes.frame(packed(kind), 0.0) is not None]
    assert 1 <= len(known) < len(kinds)


def test_a_request_without_data_is_no_data_frame() -> None:
    shapes, request = DatagramShapes(msgpack.unpackb), Frame(identifier=0x123, data=b"", is_remote=True)
    shapes.learn(packed(request), request)
    assert shapes.frame(packed(request), 0.0) is None
    shapes.learn(packed(KINDS[-1]), KINDS[-1])
    assert shapes.datagram(replace(KINDS[-1], is_remote=True)) is None
