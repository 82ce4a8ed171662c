"""python-can's configuration files: they never change an option that was given, and what they set is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import can
import pytest
from can.interfaces.virtual import VirtualBus
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.can.bridge.bus.opening import BusSettings, configured, open_bus
from strainfmu.can.bridge.options import BridgeOptions
from strainfmu.can.bridge.setup import UNPROTECTED_TEXT, bus_settings, make_bridge
from strainfmu.errors import InputError


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the only configuration file of python-can."""
    path = tmp_path / ".canrc"
    path.write_text(
        "[default]\nreceive_own_messages = true\nbitrate = 125000\nf_clock = 8000000\n"
        "[bench]\nreceive_own_messages = false\nrx_queue_size = 7\n"
    )
    monkeypatch.setattr(can.util, "CONFIG_FILES", [str(path)])
    monkeypatch.delenv("CAN_CONFIG", raising=False)
    return path


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Return what buses are opened with."""
    found: list[dict[str, Any]] = []

    def bus(**options: Any) -> can.BusABC:
        found.append(options)
        return VirtualBus("configured")

    monkeypatch.setattr(can, "Bus", bus)
    return found


def settings(**options: Any) -> BusSettings:
    context = options.pop("context", None)
    return BusSettings(interface="virtual", channel="configured", options=options, context=context)


@pytest.mark.fast
def test_what_a_file_sets_is_named(config: Path, opened: list[dict[str, Any]]) -> None:
    lines = [str(found) for found in configured(settings())]
    assert lines == [
        f"{config} [default]: sets receive_own_messages = true",
        f"{config} [default]: sets bitrate = 125000",
        f"{config} [default]: sets f_clock = 8000000",
    ]
    open_bus(settings()).shutdown()
    assert opened[0]["receive_own_messages"] is True
    assert opened[0]["ignore_config"] is True, "python-can adds nothing behind our back"


@pytest.mark.fast
def test_what_was_given_stands(config: Path, opened: list[dict[str, Any]]) -> None:
    given = settings(bitrate=500_000, receive_own_messages=False)
    assert configured(given) == [], "nor is a bit rate replaced by a bit timing"
    open_bus(given).shutdown()
    assert opened[0]["bitrate"] == 500_000
    assert opened[0]["receive_own_messages"] is False
    assert "timing" not in opened[0]
    assert "f_clock" not in opened[0]


@pytest.mark.fast
def test_a_context_comes_ahead_of_the_default(
    config: Path, opened: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CAN_CONFIG_bench", '{"preserve_timestamps": true}')
    lines = [str(found) for found in configured(settings(context="bench"))]
    assert lines[0] == "environment CAN_*_bench: sets preserve_timestamps = True"
    assert f"{config} [bench]: sets receive_own_messages = false" in lines
    assert f"{config} [default]: sets receive_own_messages = true" not in lines
    open_bus(settings(context="bench")).shutdown()
    assert opened[0]["rx_queue_size"] == 7
    assert opened[0]["receive_own_messages"] is False
    with pytest.raises(InputError, match=r"^bus\.context: no 'flight' found in .*\.canrc, CAN_CONFIG_flight$"):
        configured(settings(context="flight"))


@pytest.mark.fast
def test_the_context_of_the_options(config: Path) -> None:
    options = {"interface": "virtual", "channel": "x"}
    assert bus_settings(BridgeOptions(**options, bus_context="bench")).context == "bench"
    stated = bus_settings(BridgeOptions(**options, bus_options=("config_context=bench",)))
    assert (stated.context, dict(stated.options)) == ("bench", {})
    assert configured(settings(ignore_config=True)) == []


def dbc_of_all(folder: Path) -> dict[str, Path]:
    """Return a DBC file of all gauges, without protection, and its mapping."""
    dbc, mapping = folder / "rack.dbc", folder / "rack.toml"
    text, rows = 'VERSION ""\nNS_ :\nBS_:\nBU_: A B\n', ""
    for i in range(N_GAUGES):
        text += f"BO_ {256 + i} R{i}: 8 A\n" + ' SG_ S : 0|16@1- (0.25,0) [0|0] "um/m" B\n'
        rows += f'"G{i}" = "R{i}.S"\n'
    dbc.write_text(text)
    mapping.write_text(f"cycle_time_ms = 10\n[strain]\n{rows}")
    return {"dbc": dbc, "mapping": mapping}


def test_a_bridge_without_protection_says_so_at_the_start(
    synthetic: SyntheticFiles, config: Path, tmp_path: Path
) -> None:
    bus: dict[str, Any] = {"interface": "virtual", "channel": "x", "bus_options": ("ignore_config=true",)}
    with make_bridge(synthetic.estimator_1, BridgeOptions(**bus, dynamic_pressure=9e4)) as ready:
        assert ready.start_lines == ()
    plain = BridgeOptions(**bus, **dbc_of_all(tmp_path), dynamic_pressure=9e4)
    with make_bridge(synthetic.estimator_1, plain) as ready:
        assert ready.start_lines == (UNPROTECTED_TEXT,)
