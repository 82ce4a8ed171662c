"""The commands that use a map need numpy, h5py and the extra ``cli``; what is missing is named with its extra."""

import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
from recorded_case import write_flight
from synthetic_vehicle import SyntheticFiles

from strainfmu.cli.main import EXTRAS, missing_text

pytestmark = pytest.mark.fast

ROOT = Path(__file__).parents[2]

Run = Callable[..., tuple[int, str, str]]

WITHOUT = """
import sys
from importlib.abc import MetaPathFinder

class Missing(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {missing!r}:
            raise ModuleNotFoundError(name, name=name)

sys.meta_path.insert(0, Missing())
from strainfmu.cli.main import main
for command in {commands!r}:
    try:
        main(command)
    except SystemExit as ended:
        assert not ended.code, command
"""

OF_OTHER_EXTRAS = (
    "scipy",
    "skfem",
    "numba",
    "fmpy",
    "pythonfmu",
    "can",
    "cantools",
    "matplotlib",
    "vtk",
)


def test_a_map_is_used_with_the_smallest_extra(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    data = write_flight(tmp_path / "d.csv")
    commands = [
        ["inspect", str(synthetic.map_1)],
        ["estimate", str(synthetic.map_1), str(data), "-o", str(tmp_path / "loads.csv")],
        ["channels", str(synthetic.map_1), str(data), "-o", str(tmp_path / "channels.toml")],
    ]
    code = WITHOUT.format(missing=set(OF_OTHER_EXTRAS), commands=commands)
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert (tmp_path / "loads.csv").is_file()


def test_a_missing_package_is_named_with_its_extra(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    # None in sys.modules makes the import fail, which its type does not foresee.
    monkeypatch.setitem(sys.modules, "typer.main", None)  # type: ignore[arg-type]
    code, _, errors = run("estimate", "map.h5", "flight.csv", "-o", "o.csv")
    text = "'typer' is not installed: pip install 'strainfmu[cli]'; it is enough to estimate with a map, inspect"
    assert (code, errors) == (1, f"strainfmu: {text} and export it\n")


def test_the_extras_are_the_packages_own() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "optional-dependencies"
    ]
    assert set(EXTRAS.values()) <= set(extras)
    assert missing_text("scipy") == "'scipy' is not installed: pip install 'strainfmu[build]'"
    assert missing_text("unheard_of").endswith("pip install 'strainfmu[all]'")
