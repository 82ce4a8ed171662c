"""Suspects found with the screen in float are those of the product in double, on both sides of the threshold."""

import subprocess
from importlib.util import find_spec
from pathlib import Path

import pytest
from c_host import program_by_zig
from native_case import NativeCase

from strainfmu.fmu.native.build import source_files

SCREEN = Path(__file__).parent / "screen.c"

pytestmark = [
    pytest.mark.slow,  # test_scaled.py holds the screen of every map at its threshold, by the shipped library
    pytest.mark.skipif(find_spec("ziglang") is None, reason="needs zig: pip install 'strainfmu[native]'"),
]


@pytest.fixture(scope="module")
def screen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program that compares the two."""
    core = [path for path in source_files() if not path.parent.name.startswith("fmi")]
    return program_by_zig("native", tmp_path_factory.mktemp("screen") / "screen", [SCREEN, *core])


def test_screen_changes_nothing(case: NativeCase, screen: Path) -> None:
    if case.inverse_map.form == "dynamic_pressure":
        pytest.skip("test_scaled.py holds the screen of this form")
    done = subprocess.run(
        [str(screen), str(case.resources / "map.bin")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    tried, decided_by_screen = map(int, done.stdout.split())
    # Twelve alarm scales, two masks, with and without AVX2. Half of the biases are above the threshold, and many
    # are so close to it that the screen leaves them to z itself.
    assert tried > 4 * 12 * 100
    # It bounds variances over a range of pressures, so that it leaves more to z than half of the rest.
    assert 0.02 * tried < decided_by_screen < 0.5 * tried
