"""What a gauge as built reads of the strain of a wall, against the strain tensor along and across it."""

import numpy as np
import pytest

from builder.structure.as_built.as_built_vehicle import AsBuilt, Counts
from builder.structure.as_built.gauge_strain_terms import WallGauges
from builder.structure.fourier.inner_surface import PlacedGauges

pytestmark = pytest.mark.fast


def test_a_turned_gauge_reads_along_itself_and_a_part_across() -> None:
    """Gauges of any direction in the wall, turned by some degrees: n E n + k t E t of a random strain E."""
    random, n = np.random.default_rng(1), 9
    angle, turn, across = random.uniform(-3.0, 3.0, n), random.uniform(-0.2, 0.2, n), random.uniform(0.0, 0.1, n)
    placed = PlacedGauges(
        x=np.zeros(n), roll_angle=np.zeros(n), meridional=np.cos(angle), circumferential=np.sin(angle)
    )
    row = np.arange(n) % 3
    gauges = WallGauges(placed=placed, radius=np.ones(n), row=row, station=np.zeros(n, dtype=np.int64))
    of_row = random.uniform(-0.2, 0.2, 3)
    errors = {"orientation": turn, "row_orientation": of_row, "transverse_sensitivity": across}
    built = AsBuilt(Counts(gauge=n, row=3), errors)
    normal, shear = gauges.direction_weights(built)
    along = angle + turn + of_row[row]
    for strain in random.normal(size=(4, 2, 2)):
        strain = strain + strain.T
        unit = np.array([np.cos(along), np.sin(along)])
        aside = np.array([-unit[1], unit[0]])
        expected = np.einsum("ag,ab,bg->g", unit, strain, unit)
        expected += across * np.einsum("ag,ab,bg->g", aside, strain, aside)
        found = normal @ np.diag(strain) + shear * strain[0, 1]
        np.testing.assert_allclose(found, expected, atol=1e-14)
