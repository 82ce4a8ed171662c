"""Bodies given by sections: closed forms of ellipses, and what a file of sections may not hold."""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from builder.vehicle.shape.sectioned_body import SectionedBody, read_sections
from strainfmu.errors import InputError

pytestmark = pytest.mark.fast

CONE = "x_m,half_width_m,half_height_m\n0,0,0\n1.6,0.4,0.2\n"


def body_of(folder: Path, text: str = CONE, interpolation: str = "linear") -> SectionedBody:
    path = folder / "sections.csv"
    path.write_text(text, encoding="utf-8")
    return read_sections(path, interpolation)


def test_elliptic_cone(tmp_path: Path) -> None:
    body = body_of(tmp_path)
    roll = np.linspace(0.0, 2.0 * pi, 25)
    point = body.point(0.8, roll)
    np.testing.assert_allclose((point[:, 1] / 0.2) ** 2 + (point[:, 2] / 0.1) ** 2, 1.0, rtol=1e-12)
    # Gradient of (y/a)^2 + (z/b)^2 - x^2 with a = 0.25, b = 0.125 at x.
    gradient = np.column_stack([-point[:, 0], point[:, 1] / 0.0625, point[:, 2] / 0.015625])
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    np.testing.assert_allclose(body.normal(0.8, roll), gradient, atol=1e-8)
    np.testing.assert_allclose(body.normal(1.6, roll, -1.0)[:, 0], gradient[:, 0], atol=1e-8)
    assert body.length == 1.6
    assert len(body.slope_breaks) == 0
    assert body.radius(0.0, 1.0) == 0.0


def test_nodes_are_denser_at_narrow_edges(tmp_path: Path) -> None:
    """Evenly spaced eccentric angles t give y = a sin t, z = b cos t."""
    body = body_of(tmp_path)
    angle = np.linspace(0.0, 2.0 * pi, 17)[:-1]
    point = body.point(1.6, body.spread_roll_angle(1.6, angle))
    np.testing.assert_allclose(
        point[:, 1:], np.column_stack([0.4 * np.sin(angle), 0.2 * np.cos(angle)]), atol=1e-12
    )


def test_off_centre_and_superelliptic(tmp_path: Path) -> None:
    text = "x_m,half_width_m,half_height_m,exponent,centre_z_m\n0,0,0,2,0\n1,0.1,0.1,4,0.05\n2,0.15,0.1,4,0.02\n"
    body = body_of(tmp_path, text)
    roll = np.linspace(0.0, 2.0 * pi, 33)
    _, y, z = body.point(1.0, roll).T
    np.testing.assert_allclose(np.abs(y / 0.1) ** 4 + np.abs((z - 0.05) / 0.1) ** 4, 1.0, rtol=1e-9)
    np.testing.assert_array_equal(body.slope_breaks, [1.0])
    assert not body.is_symmetric_up_and_down
    smooth = body_of(tmp_path, text, "monotone")
    assert len(smooth.slope_breaks) == 0
    np.testing.assert_allclose(smooth.radius(1.0, roll), body.radius(1.0, roll), rtol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("half_height_m", "height", "expected the columns x_m, half_width_m, half_height_m"),
        ("0,0,0", "0,0.1,0.1", "line 2: expected the tip first, a point at x = 0"),
        ("1.6,", "0,", "line 3: x_m: expected more than 0, got 0"),
        ("0.4,", "-0.4,", "line 3: expected half_width_m and half_height_m above 0, got -0.4"),
        ("0.4,", "wide,", "line 3: expected 3 numbers, got 1.6,wide,0.2"),
        ("1.6,0.4,0.2\n", "", "expected a tip and at least one section, got 1 rows"),
        ("0.2\n", "nan\n", "line 3: expected finite numbers"),
    ],
)
def test_wrong_files_are_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        body_of(tmp_path, CONE.replace(old, new))
    assert "\n" not in str(caught.value)


def test_axis_outside_a_section_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"centre_z_m: expected the x axis inside the section"):
        body_of(tmp_path, "x_m,half_width_m,half_height_m,centre_z_m\n0,0,0,0\n1,0.1,0.1,0.2\n")
