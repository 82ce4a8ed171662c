"""zeros.toml: what is written is read, and what is wrong is named in one line."""

from pathlib import Path

import numpy as np
import pytest

from strainfmu.cosim.estimators.zeros_file import load_known_strain, load_zeros, write_zeros
from strainfmu.errors import InputError
from strainfmu.estimator.gauge_zeros import GaugeZeros

pytestmark = pytest.mark.fast

NAMES = ('A "1"', "wing\\2", "Ω.3")


def test_there_and_back(tmp_path: Path) -> None:
    zeros = GaugeZeros(value=np.array([1e-4, -2.5e-5, 0.0]), std=np.array([1e-7, 0.0, 3e-7]), common_std=2e-7)
    write_zeros(tmp_path / "z.toml", NAMES, zeros, {"recording": 'a "b".csv', "duration_s": 10.0})
    found = load_zeros(tmp_path / "z.toml", NAMES[::-1])
    np.testing.assert_allclose(found.value, zeros.value[::-1], rtol=1e-8)
    np.testing.assert_allclose(found.std, zeros.std[::-1], rtol=1e-8)
    assert found.common_std == pytest.approx(2e-7)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "gauges.a: gauge of the map is missing"),
        ("[gauges]\na = {std_um_per_m = 0}", "gauges.a.zero_um_per_m: entry is missing"),
        (
            "[gauges]\na = {zero_um_per_m = 6e4, std_um_per_m = 0}",
            "expected a number from -50000 to 50000, got 60000",
        ),
        ("[gauges]\na = {zero_um_per_m = 1, std_um_per_m = -1}", "expected a number from 0 to 50000, got -1"),
        ("[gauges]\na = {zero_um_per_m = 1, std_um_per_m = 1, x = 1}", "gauges.a.x: unknown entry"),
        (
            "[gauges]\na = {zero_um_per_m = 1, std_um_per_m = 1}\nb = {zero_um_per_m = 1, std_um_per_m = 1}",
            "gauges.b: the map has no such gauge",
        ),
        ("zeros = 1\n[gauges]\na = {zero_um_per_m = 1, std_um_per_m = 1}", "zeros: unknown entry"),
        ("a = ", "not a TOML file"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "z.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message.replace(".", r"\.")) as caught:
        load_zeros(path, ["a"])
    assert str(caught.value).startswith(f"{path}: ")


def test_zeros_and_known_loads_do_not_stand_for_each_other(tmp_path: Path) -> None:
    """Both files have one form; a tare that takes its own zeros off finds none."""
    held = GaugeZeros(value=np.full(3, 1e-5), std=np.full(3, 1e-7))
    zeros, loads, plain = (tmp_path / name for name in ("zeros.toml", "known.toml", "plain.toml"))
    write_zeros(zeros, NAMES, held, {"recording": "a.csv", "vehicle": "v.toml", "ambient_pressure_Pa": 1e5})
    write_zeros(loads, NAMES, held, {"vehicle": "v.toml", "ambient_pressure_Pa": 0.0})
    write_zeros(plain, NAMES, held, {})
    for path in (zeros, plain):
        np.testing.assert_allclose(load_zeros(path, NAMES).value, held.value)
    for path in (loads, plain):
        np.testing.assert_allclose(load_known_strain(path, NAMES).std, held.std)
    with pytest.raises(InputError, match=r"expected zeros, .* got the strain of known loads"):
        load_zeros(loads, NAMES)
    with pytest.raises(InputError, match=r"expected the strain of known loads, .*, got zeros"):
        load_known_strain(zeros, NAMES)
    write_zeros(plain, NAMES, GaugeZeros(value=held.value, std=held.std, common_std=3e-6), {})
    with pytest.raises(InputError, match="common_std_um_per_m: expected 0 of known loads, got 3"):
        load_known_strain(plain, NAMES)
