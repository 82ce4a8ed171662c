"""The compiled part of the bridge: it takes nothing of another shape; what a machine without it says."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from can_case import SIZES, layout_of

from strainfmu.can.cycle.frames.assembler import Arrival
from strainfmu.can.cycle.frames.decoder import StrainDecoder
from strainfmu.can.cycle.frames.reception import Reception
from strainfmu.can.settings import BridgeSettings
from strainfmu.can.wire import compiled
from strainfmu.can.wire.frame import Frame
from strainfmu.can.wire.signal_plan import SignalPlan
from strainfmu.estimator import core
from strainfmu.estimator.core import NoCoreError

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("profile", SIZES)
def test_frames_of_another_length_are_read_by_no_part(profile: str) -> None:
    """The first filter refuses them; behind it nothing reads beyond their end."""
    layout = layout_of(profile, SIZES[profile])
    reception, decoder = Reception(layout, BridgeSettings()), StrainDecoder(layout)
    for item in layout.frames:
        own = item.layout
        for length in (0, own.length - 1, own.length + 1):
            frame = Frame(identifier=own.identifier, data=bytes(length), is_fd=own.is_fd)
            with pytest.raises(ValueError, match=f"expected {own.length} bytes, got {length}"):
                reception.take(frame)
    short = Frame(identifier=1, data=b"")
    arrival = Arrival(slot=0, frame=short, plan=SignalPlan(layout.strain_frames[0].layout))
    with pytest.raises(ValueError, match="bytes, got"):
        decoder.decode({arrival.slot: arrival.frame.data}, 0, decoder.new_cycle())


def test_arrays_in_pieces_have_no_address() -> None:
    with pytest.raises(AssertionError):
        compiled.address(np.zeros(8)[::2])


@pytest.fixture
def without_library(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """A machine for which no library is shipped, and which has no compiler."""
    monkeypatch.setattr(core, "library_file", lambda: tmp_path / "none.so")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setitem(sys.modules, "ziglang", None)
    caches = (core.library, compiled._library)
    for cached in caches:
        cached.cache_clear()
    yield
    for cached in caches:
        cached.cache_clear()


@pytest.mark.usefixtures("without_library")
def test_a_machine_without_library_and_compiler_has_no_bridge() -> None:
    with pytest.raises(
        NoCoreError, match=r"^the compiled estimator: no library .* found: install one, or ziglang$"
    ):
        Reception(layout_of("fd64"), BridgeSettings())
