"""A vehicle file, or a file that it names, is another file: refused in a line that shows nothing of it.

Passwords, keys, binaries and devices without end; memory is measured in a process of its own.
"""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from changed_vehicle import TEXT, replaced

from builder.aero.cfd.formats.point_table import read_point_table
from builder.aero.cfd.formats.text_numbers import numbers_of, read_file
from builder.aero.cfd.manifest import load_manifest
from builder.inverse.problem import nuisance_terms
from builder.structure.external.nastran.results import read_nastran_gauges
from builder.structure.external.strain_table import read_strain_table
from builder.vehicle.file import load_vehicle
from builder.vehicle.flight_conditions import read_conditions
from builder.vehicle.gauges.layout import read_gauge_table, read_layout
from builder.vehicle.shape.profile_entries import read_profile
from builder.vehicle.shape.sectioned_body import read_sections
from strainfmu.cosim.models.trajectory import load_trajectory
from strainfmu.errors import InputError
from strainfmu.text_files import LARGEST, read_text

SECRET = "hunter2"
MISTAKES = {
    "passwords": f"root:x:0:0:{SECRET}:/root:/bin/bash\nsync:x:4:{SECRET}::/bin:/bin/sync\n".encode(),
    "settings": f'{SECRET} = "{SECRET}"\npassword = "{SECRET}"\n'.encode(),
    "key": f"-----BEGIN {SECRET} KEY-----\nMIIE{SECRET}vQIBADANBg==\n-----END KEY-----\n".encode(),
    "table": f"user,{SECRET},mail\nadmin,{SECRET},a@b.c\n".encode(),
    "binary": f"\x7fELF\x02\x01{SECRET}".encode() + bytes(64),
    "bytes": SECRET.encode() + np.random.default_rng(8).bytes(4000).replace(b"\0", b"\1"),
}
Read = Callable[[Path], object]


def point_values(path: Path) -> object:
    return read_point_table(path, None, 1.0)


def numbers(path: Path) -> object:
    return numbers_of(path, read_file(path))


def gauge_modes(path: Path) -> object:
    return nuisance_terms(path, ("a", "b"))


def nastran_gauges(path: Path) -> object:
    return read_nastran_gauges(path, {})


READERS: dict[str, Read] = {
    "vehicle.toml": load_vehicle,
    "gauges.csv": read_layout,
    "surface_gauges.csv": read_gauge_table,
    "nastran_gauges.csv": nastran_gauges,
    "nuisance.csv": gauge_modes,
    "profile.csv": read_profile,
    "sections.csv": read_sections,
    "conditions.csv": read_conditions,
    "manoeuvre.csv": load_trajectory,
    "strains.csv": read_strain_table,
    "manifest.csv": load_manifest,
    "manifest.toml": load_manifest,
    "points.csv": point_values,
    "surface.tri": numbers,
}


@pytest.mark.parametrize("mistake", MISTAKES)
@pytest.mark.parametrize("name", READERS)
def test_nothing_of_another_file_is_shown(tmp_path: Path, name: str, mistake: str) -> None:
    path = tmp_path / name
    path.write_bytes(MISTAKES[mistake])
    with pytest.raises(InputError) as caught:
        READERS[name](path)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    assert SECRET not in message
    assert message.isprintable()


def test_slips_in_a_right_file_are_shown(tmp_path: Path) -> None:
    """A file with columns or entries as expected is meant: its own words help."""
    (tmp_path / "gauges.csv").write_text("name,x_mm,y_m,z_m,direction_x,direction_y,direction_z\n")
    with pytest.raises(InputError, match="got name, x_mm, y_m"):
        read_layout(tmp_path / "gauges.csv")
    (tmp_path / "vehicle.toml").write_text(replaced(TEXT, ("[map]", "[mapp]")))
    with pytest.raises(InputError, match=r"mapp: unknown entry, did you mean map\?"):
        load_vehicle(tmp_path / "vehicle.toml")


def test_a_file_that_is_too_large_is_given_up(tmp_path: Path) -> None:
    path = tmp_path / "huge.csv"
    path.write_bytes(b"name,x_m,y_m,z_m,direction_x,direction_y,direction_z\n" * (LARGEST // 50))
    with pytest.raises(InputError, match=r"huge\.csv: not a CSV file: expected at most 16 MiB, got more"):
        read_layout(path)


def test_a_folder_and_a_missing_file_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=re.escape(f"{tmp_path}: cannot be read: ")):
        read_text(tmp_path, "CSV file")
    with pytest.raises(InputError, match=r"none\.csv: no such file"):
        read_text(tmp_path / "none.csv", "CSV file")


MEASURED = """
import json, re, sys
from strainfmu.cli.main import main
try:
    main(sys.argv[1:])
except SystemExit as ended:
    peak = int(re.search(r"VmHWM:\\s*(\\d+) kB", open("/proc/self/status").read()).group(1))
    print(json.dumps([int(ended.code or 0), peak]))
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from Linux's /proc")
def test_a_gauge_file_without_end_is_refused_within_a_gibibyte(tmp_path: Path) -> None:
    text = replaced(TEXT, ("[gauges.layouts.configuration_2]\nrows", "[gauges.layouts.others]\nrows"))
    layout = '[gauges.layouts.configuration_2]\nfile = "/dev/zero"\n'
    path = tmp_path / "vehicle.toml"
    path.write_text(replaced(text, ("[conditions]", f"{layout}\n[conditions]")))
    command = [sys.executable, "-c", MEASURED, "check", str(path)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    code, peak_kib = json.loads(done.stdout.splitlines()[-1])
    assert code == 2
    assert "strainfmu: /dev/zero: not a CSV file: expected text, got bytes of 0\n" in done.stderr
    assert peak_kib < 2**20
