"""The source's flight conditions and gauges, as its text gives them."""

import numpy as np
import pytest

from builder.reproduce.paper_readings import ALL, READINGS, SHIPPED, gauges_of_45, with_all_gauges
from builder.reproduce.protocol import EXAMPLES, HELD_OUT, P1, P2, PAPER, QUICK, sized
from builder.reproduce.studies import left_out
from builder.structure.fourier.fourier_model import place_layouts
from builder.structure.fourier.shell_mesh import shell_mesh
from builder.structure.gauge_checks import check_gauges
from builder.structure.wall import wall_of
from builder.vehicle.file import IC3X, load_vehicle
from builder.vehicle.flight_conditions import flow_key

pytestmark = pytest.mark.fast


def test_numbers_of_snapshots_and_membership_of_the_examples() -> None:
    assert (len(P1.conditions), len(P2.conditions)) == (90, 243)
    assert EXAMPLES["m5_a6_b5"] in P1.conditions
    assert EXAMPLES["m7_a2_b8"] not in P1.conditions
    assert EXAMPLES["m5_a6_b6"] in P2.conditions
    assert EXAMPLES["m6_a0_b5"] not in P2.conditions


def test_held_out_flows_are_none_of_the_snapshots() -> None:
    known = {flow_key(one) for one in (*P1.conditions, *P2.conditions)}
    assert not known & {flow_key(one) for one in HELD_OUT.conditions}


def test_mirror_images_of_the_example_are_left_out_with_it() -> None:
    gone = [one for one, out in zip(P2.conditions, left_out(), strict=True) if out]
    angles = {
        (round(float(np.degrees(c.angle_of_attack))), round(float(np.degrees(c.sideslip_angle)))) for c in gone
    }
    assert {c.mach_number for c in gone} == {5.0}
    assert angles == {(6, 6), (6, -6), (-6, 6), (-6, -6)}


@pytest.mark.parametrize("reading", READINGS, ids=lambda one: one.name)
def test_every_reading_has_the_published_numbers_of_gauges(reading) -> None:
    first, second = reading.configuration(1), reading.configuration(2)
    assert (len(first), len(second)) == (27, 54)
    assert sum(name.startswith("axial") for name in first) == 18
    assert sum(name.startswith("hoop") for name in first) == 9
    assert set(first) < set(second)


def test_configuration_2_is_configuration_1_with_its_mirror_images() -> None:
    # "sensors in the xy-plane are reflected across the xz-plane, and sensors in the xz-plane across the xy-plane"
    vehicle = with_all_gauges(load_vehicle(IC3X))
    mesh = shell_mesh(vehicle.body(), wall_of(vehicle), 0.05)
    layout = place_layouts(vehicle, mesh, [ALL])[0][ALL]
    position = dict(zip(layout.names, layout.position, strict=True))
    for reading in READINGS:
        first = reading.configuration(1)
        mirrored = {(name[:4], *np.round(position[name] * [1.0, -1.0, -1.0], 9)) for name in first}
        added = set(reading.configuration(2)) - set(first)
        assert {(name[:4], *np.round(position[name], 9)) for name in added} == mirrored


def test_layouts_fit_the_vehicle_and_45_has_as_many_gauges() -> None:
    vehicle = load_vehicle(IC3X)
    names = gauges_of_45(vehicle)
    assert len(set(names)) == 54
    assert sum(name.startswith("axial") for name in names) == 36
    assert check_gauges(with_all_gauges(vehicle))[ALL] == 72 + 18
    assert len(SHIPPED.configuration(2)) == len(names)


@pytest.mark.parametrize("sizes", [PAPER, QUICK], ids=lambda one: one.name)
def test_meshes_put_nodes_on_the_rows(sizes) -> None:
    # Rows at multiples of 45 deg read alike only where the mesh repeats there.
    assert sizes.surface_roll_angles % 8 == 0
    assert sizes.hexahedra.n_sectors % 8 == 0
    assert sizes.tetrahedra.n_sectors % 8 == 0
    vehicle = sized(load_vehicle(IC3X), sizes)
    assert vehicle.resolution.map.surface_stations == sizes.surface_stations
