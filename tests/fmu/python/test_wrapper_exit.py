"""Hosts of Python FMUs end without a damaged heap, whatever language they are written in."""

import os
import shutil
import site
import subprocess
import sys
import sysconfig
from pathlib import Path

import fmpy
import pytest

pytestmark = pytest.mark.fast

HOST = Path(__file__).parent / "foreign_host.c"


@pytest.fixture(scope="module")
def foreign_host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the C host, compiled."""
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        pytest.skip("needs a C compiler: apt install gcc libc6-dev")
    program = tmp_path_factory.mktemp("host") / "foreign_host"
    headers = Path(fmpy.__file__).parent / "c-code"
    subprocess.run([compiler, f"-I{headers}", str(HOST), "-o", str(program), "-ldl"], check=True)
    return program


@pytest.fixture(scope="module")
def interpreter() -> Path:
    """Return the shared library of this Python, which foreign hosts of PythonFMU must have loaded."""
    library = Path(sysconfig.get_config_var("LIBDIR") or "", sysconfig.get_config_var("INSTSONAME") or "")
    if library.suffix == ".a" or not library.is_file():
        pytest.skip("needs a Python that was built with --enable-shared")
    return library


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_a_host_may_unload_the_wrapper(fmus: dict[str, Path]) -> None:
    # FMPy unzips into a new folder each time: a hold on each library would add up.
    before = loaded_libraries()
    for _ in range(3):
        fmpy.simulate_fmu(str(fmus["python"]), stop_time=0.02)
    assert len(loaded_libraries() - before) <= 1


def loaded_libraries() -> set[str]:
    """Return the libraries of unzipped FMUs in this process; source: Linux, proc(5)."""
    lines = Path("/proc/self/maps").read_text().splitlines()
    return {line.split()[5] for line in lines if "binaries/linux64" in line}


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="loads the FMU's library for Linux")
def test_a_host_without_an_interpreter_cannot_load_it(
    fmus: dict[str, Path], foreign_host: Path, tmp_path: Path
) -> None:
    """As the FMU's page says, and the export."""
    fmpy.extract(str(fmus["python"]), str(tmp_path))
    (library,) = (tmp_path / "binaries" / "linux64").glob("*.so")
    command = [foreign_host, library, "guid", (tmp_path / "resources").as_uri()]
    environment = {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"}
    finished = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert finished.returncode != 0
    assert "undefined symbol" in finished.stderr
    page = (tmp_path / "documentation" / "index.html").read_text(encoding="utf-8")
    assert "A host that holds no Python interpreter of its own" in page


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="loads the FMU's library for Linux")
@pytest.mark.parametrize("unload", [False, True])
@pytest.mark.parametrize("kind", ["python", "plant"])
def test_a_foreign_host_ends_well(
    fmus: dict[str, Path], foreign_host: Path, interpreter: Path, tmp_path: Path, kind: str, unload: bool
) -> None:
    # Without the slave's call at exit, each of these ends with "free(): corrupted unsorted chunks".
    description = fmpy.read_model_description(str(fmus[kind]))
    fmpy.extract(str(fmus[kind]), str(tmp_path))
    (library,) = (tmp_path / "binaries" / "linux64").glob("*.so")
    finished = subprocess.run(
        [foreign_host, library, description.guid, (tmp_path / "resources").as_uri(), *["unload"] * unload],
        env=os.environ | {"LD_PRELOAD": str(interpreter), "PYTHONPATH": os.pathsep.join(site.getsitepackages())},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (finished.returncode, finished.stdout) == (0, "done\n"), finished.stderr
