"""Multicast on this machine."""

from __future__ import annotations

import pytest

from builder.pipeline.demonstration.bus_flight import check_multicast, private_port
from strainfmu.errors import StrainfmuError


def skip_without_multicast() -> None:
    """Skip the test where datagrams do not come back."""
    try:
        check_multicast(private_port())
    except StrainfmuError as error:
        pytest.skip(str(error))  # some containers have no multicast; the error says what fails
