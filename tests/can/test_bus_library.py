"""The compiled part of the bridge: it takes nothing of another shape; what a machine without it says."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from can_case import SIZES, Projection, layout_of

from strainfmu.can import signals
from strainfmu.can.frame import Frame
from strainfmu.can.machine import Machine
from strainfmu.can.options import BridgeSettings
from strainfmu.can.quality import Cause, FrameClass
from strainfmu.can.signals import SignalPlan
from strainfmu.estimator import core
from strainfmu.estimator.core import NoCoreError

pytestmark = pytest.mark.fast


@pytest.mark.parametrize("profile", SIZES)
def test_frames_of_another_length_are_read_by_no_part(profile: str) -> None:
    layout, n = layout_of(profile, SIZES[profile]), 0
    machine = Machine(layout, Projection(layout.n_gauges), BridgeSettings(), start=0.0)
    for item in layout.frames:
        own = item.layout
        for length in (0, own.length - 1, own.length + 1):
            machine.receive(Frame(identifier=own.identifier, data=bytes(length), is_fd=own.is_fd))
            n += 1
    assert machine.account.classes[FrameClass.WRONG_FORMAT] == machine.account.received == n
    with pytest.raises(ValueError, match="bytes, got 0"):
        SignalPlan(layout.strain_frames[0].layout).raw(b"")


def test_each_cause_is_set_in_c_or_in_python() -> None:
    header = Path("fmus/native/bus/bus.h").read_text("utf-8")
    results = re.findall(r"enum \{(.*?)\}", header[header.index("/* Causes, bit by bit") :], re.DOTALL)[0]
    in_c = {1 << int(bit) for bit in re.findall(r"SB_\w+ = 1 << (\d+)", results)}
    in_python = "".join(path.read_text("utf-8") for path in Path("strainfmu/can").rglob("*.py"))
    unset = [one.name for one in Cause if one.value not in in_c and f"Cause.{one.name}" not in in_python]
    assert unset == []


def test_arrays_in_pieces_have_no_address() -> None:
    with pytest.raises(AssertionError):
        signals.pointer(np.zeros(8)[::2])


@pytest.fixture
def without_library(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """A machine for which no library is shipped, and which has no compiler."""
    monkeypatch.setattr(core, "library_file", lambda: tmp_path / "none.so")
    for name in ("PATH", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setitem(sys.modules, "ziglang", None)
    caches = (core.library, signals.functions)
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
        SignalPlan(layout_of("fd64").strain_frames[0].layout)
