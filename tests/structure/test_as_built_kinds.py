"""The table of kinds of error: every use has the table's kinds, and every entry that it names exists."""

from dataclasses import fields

import pytest

from builder.calibration.ground_test.load_test import LoadErrors
from builder.calibration.ground_test.load_test_file import ErrorEntries
from builder.structure.as_built.as_built_vehicle import exactly_built
from builder.structure.as_built_kinds import ALWAYS_DRAWN, AS_BUILT, IN_FLIGHT, IN_NOISE, KINDS, OF_LOADS
from builder.vehicle.map_options import HARDWARE_ERRORS, Calibration, Noise

pytestmark = pytest.mark.fast


def test_every_use_holds_the_kinds_of_the_table() -> None:
    assert len(KINDS) == len(AS_BUILT) + len(IN_FLIGHT) + len(OF_LOADS)
    assert list(exactly_built(3).errors) == [kind.name for kind in (*AS_BUILT, *IN_FLIGHT)]
    assert {kind.name for kind in IN_NOISE} == {k.name for k in KINDS.values() if "noise" in k.sections}
    assert IN_NOISE[: len(ALWAYS_DRAWN)] == tuple(KINDS[name] for name in ALWAYS_DRAWN)
    assert {kind.name for kind in OF_LOADS} <= {one.name for one in fields(LoadErrors)}
    assert {kind.entry for kind in KINDS.values() if "noise" in kind.sections} == set(HARDWARE_ERRORS)


def test_sizes_are_those_of_the_sections() -> None:
    prior, loads, noise = Calibration(), ErrorEntries(), Noise(std_um_per_m=1.0)
    for kind in AS_BUILT:
        assert kind.std(prior) == pytest.approx(kind.scale * getattr(prior, kind.entry), rel=1e-12)
        assert (kind.std(prior) == 0.0) >= kind.taken_for_zero
    assert loads.errors() == LoadErrors()
    assert KINDS["orientation"].std(noise) == pytest.approx(0.0174533 * noise.gauge_orientation_deg, rel=1e-5)
    assert KINDS["axial_shift"].std(noise) == 1e-3 * noise.gauge_position_mm
