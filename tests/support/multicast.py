"""Multicast on this machine."""

import socket

import pytest

from builder.pipeline.demonstration.bus_flight import check_multicast, private_port
from strainfmu.errors import StrainfmuError


def skip_without_multicast() -> None:
    """Skip the test where datagrams do not come back."""
    try:
        check_multicast(private_port())
    except StrainfmuError as error:
        pytest.skip(str(error))  # some containers have no multicast; the error says what fails


def free_port() -> int:
    """Return a UDP port that no process of this machine uses now, so that runs do not hear each other."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port: int = probe.getsockname()[1]
    return port
