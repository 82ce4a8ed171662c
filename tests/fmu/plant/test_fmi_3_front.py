"""The FMI 3.0 front over the plant, which is not its first model: the outputs are those of FMI 2.0."""

import ctypes
from collections.abc import Iterator
from ctypes import byref, c_bool, c_double, c_int32, c_size_t, c_void_p
from pathlib import Path

import fmpy
import numpy as np
import pytest
from raw_fmu import DISCARD, ERROR, OK, Fmu2, Fmu3, this_platform
from synthetic_vehicle import N_GAUGES, SyntheticFiles

from strainfmu.fmu.native.build import library_file
from strainfmu.fmu.plant_export import export_native_plant
from strainfmu.interface.plant_variables import FlightStart, Motion

STEP = 0.01


class Plants:
    """The same plant behind both fronts, and its variables by name."""

    def __init__(self, fmu: Path, folder: Path) -> None:
        fmpy.extract(str(fmu), str(folder))
        description = fmpy.read_model_description(str(fmu))
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.outputs = [
            v.valueReference for v in description.modelVariables if v.causality == "output" and v.type == "Real"
        ]
        self.location, self.guid = (folder / "resources").as_uri(), description.guid
        self.library = ctypes.CDLL(str(library_file(this_platform(), "plant")))
        self.second = Fmu2(self.location, N_GAUGES, self.guid, self.library)
        self.third = Fmu3(self.location, N_GAUGES, self.guid, self.library)
        self.reached = 0.0

    def step(self, time: float) -> int:
        """Status of a step in FMI 3.0, after which the flags are those of the status."""
        event, end, early, reached = c_bool(True), c_bool(True), c_bool(True), c_double(-1.0)
        arguments = (c_double(time), c_double(STEP), c_bool(True), byref(event), byref(end), byref(early))
        status = self.third.call("DoStep", *arguments, byref(reached))
        assert (event.value, end.value, early.value) == (False, status == DISCARD, False)
        self.reached = reached.value
        assert status == DISCARD or self.reached == time + STEP
        return status

    def both(self) -> tuple[bytes, bytes]:
        """Outputs in FMI 2.0 and 3.0."""
        status, values = self.third.get("Float64", c_double, self.outputs, len(self.outputs))
        assert status == OK
        return self.second.get_reals(self.outputs).tobytes(), values.tobytes()


@pytest.fixture
def plants(synthetic: SyntheticFiles, tmp_path: Path) -> Iterator[Plants]:
    """A plant of the short-period motion behind both fronts."""
    start = FlightStart(mach_number=6.0, altitude=20e3, angle_of_attack=0.08)
    path = tmp_path / "plant.fmu"
    export_native_plant(synthetic.flight_model, path, Motion.SHORT_PERIOD, start)
    made = Plants(path, tmp_path / "unpacked")
    yield made
    made.second.free()
    made.third.free()


def test_outputs_are_those_of_fmi_2(plants: Plants) -> None:
    seed, kind, value = (plants.references[name] for name in ("seed", "fault_kind[2]", "fault_value[2]"))
    assert plants.third.set("Int32", c_int32, [seed], [7]) == OK
    assert plants.second.call("SetInteger", plants.second.references([seed]), c_size_t(1), byref(c_int32(7))) == OK
    plants.second.start()
    plants.third.start()
    assert plants.third.set("Int32", c_int32, [seed], [8]) == ERROR
    assert "is fixed" in plants.third.messages[-1][2]
    seen = set()
    for k in range(5):
        if k == 2:
            assert plants.third.set("Int32", c_int32, [kind], [2]) == OK
            assert plants.third.set("Float64", c_double, [value], [1e-3]) == OK
            one = plants.second.references([kind])
            assert plants.second.call("SetInteger", one, c_size_t(1), byref(c_int32(2))) == OK
            plants.second.set_reals([value], np.array([1e-3]))
        assert plants.second.step(k * STEP, STEP) == plants.step(k * STEP) == OK
        second, third = plants.both()
        assert second == third
        seen.add(third)
    assert len(seen) == 5
    assert plants.third.get("Int32", c_int32, [kind], 1)[1].tolist() == [2]
    time = len(plants.references)  # its value reference comes behind those of the variables
    assert plants.third.get("Float64", c_double, [time], 1)[1].tolist() == [0.05]


def test_states_move_between_instances_but_not_between_fronts(plants: Plants) -> None:
    plants.second.start()
    plants.third.start()
    state, before = c_void_p(None), plants.both()[1]
    assert plants.third.call("GetFMUState", byref(state)) == OK
    plants.step(0.0)
    assert plants.both()[1] != before
    assert plants.second.call("SetFMUstate", state) == ERROR
    assert plants.third.call("SetFMUState", state) == OK
    assert plants.both()[1] == before
    assert plants.third.call("FreeFMUState", byref(state)) == OK


def test_what_the_plant_does_not_have_is_refused(plants: Plants) -> None:
    plants.third.start()
    exchange = Fmu3(plants.location, N_GAUGES, plants.guid, plants.library, co_simulation=False)
    assert exchange.instance.value is None
    assert exchange.messages[-1][2] == "this FMU is for co-simulation"
    assert plants.third.differentiate("Directional", plants.outputs[:1], plants.outputs[:1], [1.0], 1)[0] == ERROR
    assert plants.third.messages[-1][2].endswith("is not supported by this FMU")
    for kind, c_type in (
        ("Float64", c_double),
        ("Int32", c_int32),
        ("Int64", ctypes.c_int64),
        ("Boolean", c_bool),
    ):
        assert plants.third.get(kind, c_type, [len(plants.references) + 1], 1)[0] == ERROR
        assert "no variable of that type" in plants.third.messages[-1][2]


def test_a_step_out_of_the_envelope_is_discarded(plants: Plants) -> None:
    mach = plants.references["mach_number"]
    plants.third.start()
    assert plants.third.set("Float64", c_double, [mach], [60.0]) == OK
    assert plants.step(0.0) == plants.step(STEP) == DISCARD
    assert plants.reached == 0.0  # where the last step ended that was not discarded
    assert [message[:2] for message in plants.third.messages] == [(DISCARD, "logStatusDiscard")]
