"""Plant, autopilot and schedule as packages: compliant, reproducible, and safe when damaged."""

import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmu_host import loaded
from lxml import etree
from synthetic_vehicle import SyntheticFiles

from strainfmu.cosim.models.schedule import ScheduledSignal
from strainfmu.cosim.systems.instance import Instance, read_description
from strainfmu.errors import InputError, StrainfmuError
from strainfmu.fmu.native.build import PLATFORMS, library_file
from strainfmu.fmu.plant_export import export_native_plant, export_schedule
from strainfmu.interface.fmi_variables import Variable
from strainfmu.interface.plant_variables import FlightStart, Motion

START = FlightStart(mach_number=6.0, altitude=20e3)
SIGNALS = [
    ScheduledSignal(
        Variable(name="a", description="one", causality="output", unit="rad"), (0.0, 0.1, 0.3), (1.0, 2.0, 3.0)
    ),
    ScheduledSignal(
        Variable(name="b", description="two", causality="output", variability="discrete", fmi_type="Integer"),
        (0.0, 0.2),
        (4.0, -5.0),
    ),
]


def make(synthetic: SyntheticFiles, folder: Path) -> dict[str, Path]:
    """Every FMU that needs no rising C_N."""
    fmus = {name: folder / f"{name}.fmu" for name in ("inputs", "trajectory", "short_period", "schedule")}
    for motion in Motion:
        trajectory = synthetic.trajectory if motion is Motion.TRAJECTORY else None
        export_native_plant(
            flight_model_path=synthetic.flight_model,
            fmu_path=fmus[motion.name.lower()],
            motion=motion,
            start=START,
            trajectory_path=trajectory,
        )
    export_schedule(SIGNALS, fmus["schedule"])
    return fmus


@pytest.fixture(scope="module")
def fmus(synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return make(synthetic, tmp_path_factory.mktemp("packages"))


@pytest.mark.parametrize("name", ["inputs", "trajectory", "short_period", "schedule"])
def test_compliance(fmus: dict[str, Path], name: str) -> None:
    assert validate_fmu(str(fmus[name])) == []
    schema = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
    with zipfile.ZipFile(fmus[name]) as archive:
        root = etree.fromstring(archive.read("modelDescription.xml"))
    etree.XMLSchema(etree.parse(str(schema))).assertValid(root)


def test_fmutool_finds_nothing(fmus: dict[str, Path], checked_by_fmutool: Callable[[Path], str]) -> None:
    for path in fmus.values():
        assert "seems to be compliant with FMI-2.0" in checked_by_fmutool(path)


def test_equal_exports_are_equal_to_the_byte(
    fmus: dict[str, Path], synthetic: SyntheticFiles, tmp_path: Path
) -> None:
    for name, path in make(synthetic, tmp_path).items():
        assert path.read_bytes() == fmus[name].read_bytes(), name


def test_every_platform_is_shipped(fmus: dict[str, Path]) -> None:
    for platform in PLATFORMS:
        assert library_file(platform, "plant").is_file()
    with zipfile.ZipFile(fmus["inputs"]) as archive:
        names = archive.namelist()
    of_fmi2 = [name for name in PLATFORMS if name != "aarch64-darwin"]  # in darwin64's universal library
    expected = {f"binaries/{platform}/StrainedVehicle{PLATFORMS[platform].suffix}" for platform in of_fmi2}
    assert {name for name in names if name.startswith("binaries/")} == expected
    files = ("plant/plant.c", "autopilot/autopilot.c", "schedule/schedule.c", "fmi2/fmi2.c")
    assert {f"sources/{name}" for name in files} <= set(names)


def test_schedule_jumps_at_its_times(fmus: dict[str, Path], tmp_path: Path) -> None:
    with loaded(fmus["schedule"], tmp_path / "x") as host:
        host.initialize()
        found = []
        for k in range(5):
            found.append((host.get(["a"])[0], host.integers(["b"])[0]))
            host.fmu.doStep(k * 0.1, 0.1)
    assert found == [(1.0, 4), (2.0, 4), (2.0, -5), (3.0, -5), (3.0, -5)]


def test_schedules_that_cannot_be() -> None:
    variable = Variable(name="a", description="one", causality="output")
    for times, values in (((), ()), ((0.0, 0.0), (1.0, 2.0)), ((0.0,), (1.0, 2.0)), ((0.0,), (np.nan,))):
        with pytest.raises(InputError, match="schedule"):
            ScheduledSignal(variable, times, values)


def test_a_trajectory_for_the_motion_on_one_only(synthetic: SyntheticFiles, tmp_path: Path) -> None:
    for motion, trajectory in ((Motion.TRAJECTORY, None), (Motion.INPUTS, synthetic.trajectory)):
        with pytest.raises(InputError, match="trajectory"):
            export_native_plant(
                flight_model_path=synthetic.flight_model,
                fmu_path=tmp_path / "x.fmu",
                motion=motion,
                start=START,
                trajectory_path=trajectory,
            )


def cut(content: bytes) -> bytes:
    return content[:-8]


def altered(content: bytes) -> bytes:
    return content[:3000] + bytes([content[3000] ^ 1]) + content[3001:]


def other_version(content: bytes) -> bytes:
    return content[:8] + b"\x09\0\0\0" + content[12:]


def other_guid(content: bytes) -> bytes:
    return content


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (cut, "cut or extended"),
        (altered, "checksum is wrong"),
        (other_version, "format version 9, must be 2"),
        (lambda _: b"", "is no model"),
        (None, "cannot be opened"),
        (other_guid, "guid"),
    ],
)
def test_damaged(
    fmus: dict[str, Path], tmp_path: Path, damage: Callable[[bytes], bytes] | None, message: str
) -> None:
    folder = tmp_path / "Jürgen + (1)"
    fmpy.extract(str(fmus["inputs"]), str(folder))
    resource = folder / "resources" / "model.bin"
    description = read_description(fmus["inputs"])
    if damage is None:
        resource.unlink()
    elif damage is other_guid:
        description.guid = "{0}"
    else:
        resource.write_bytes(damage(resource.read_bytes()))
    with pytest.raises(StrainfmuError, match=message):
        Instance("plant", fmus["inputs"], description, folder)
    shutil.rmtree(folder)
