"""Colours of the page: read against white, and VALID told from every other quality by colour-blind people."""

import re

import numpy as np
import pytest

from strainfmu.can.quality import Quality
from strainfmu.monitor.server import page_file

# Linear RGB to linear RGB as dichromats see it: F. Vienot, H. Brettel, J. Mollon, "Digital video colourmaps for
# checking the legibility of displays by dichromats", Color Research and Application 24 (1999) 243-252, eq. of both
# kinds multiplied out.
DICHROMATS = {
    "protan": np.array([[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]]),
    "deutan": np.array([[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]]),
}


def linear(text: str) -> np.ndarray:
    """Return linear RGB of "#rrggbb" by the sRGB curve, IEC 61966-2-1."""
    value = np.array([int(text[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def luminance(colour: np.ndarray) -> float:
    return float(colour @ np.array([0.2126, 0.7152, 0.0722]))


def lab(colour: np.ndarray) -> np.ndarray:
    """Return CIE L*a*b* of linear RGB, white D65."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ colour
    f = np.cbrt(np.maximum(xyz, 0.0) / np.array([0.9505, 1.0, 1.089]))
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


def colours() -> dict[str, np.ndarray]:
    style = page_file("/page/monitor.css").decode()
    names = {quality: quality.name.lower().replace("_", "-") for quality in Quality}
    used = dict(re.findall(r"\.q(\d) \{ --q: var\(--([a-z-]+)\)", style))
    assert used == {str(int(quality)): name for quality, name in names.items()}
    found = dict(re.findall(r"--([a-z-]+): (#[0-9a-f]{6})", style))
    return {name: linear(found[name]) for name in names.values()}


@pytest.mark.fast
def test_white_is_read_on_every_quality() -> None:
    for name, colour in colours().items():
        assert 1.05 / (luminance(colour) + 0.05) >= 4.5, name  # WCAG 2.1, 1.4.3


@pytest.mark.fast
@pytest.mark.parametrize("kind", DICHROMATS)
def test_valid_looks_like_no_other_quality(kind: str) -> None:
    seen = {name: lab(DICHROMATS[kind] @ colour) for name, colour in colours().items()}
    for name in seen.keys() - {"valid"}:
        # 10 is many times what is just noticed, about 2.3.
        assert np.linalg.norm(seen["valid"] - seen[name]) > 10.0, name


@pytest.mark.fast
def test_every_quality_has_a_sign_of_its_own() -> None:
    script = page_file("/page/histories.js").decode()
    table = re.search(r"SYMBOLS = \{(.*?)\};", script)
    assert table is not None
    signs = dict(re.findall(r'(\w+): "(.)"', table[1]))
    assert set(signs) == {quality.name for quality in Quality}
    assert len(set(signs.values())) == len(signs)
