"""The names of an FMU's signals stand in few product files: what carries them iterates over tables."""

import ast
import re
from collections import Counter
from functools import cache

import pytest
from flight_maps import whole_map
from inertia_maps import with_masses
from other_load_maps import with_further_tables
from rooms import ROOT, nodes_of
from sensor_maps import with_sensors
from thermal_maps import with_temperature

from strainfmu.estimator.air_inputs import INERTIAL_NAMES
from strainfmu.estimator.other_loads import ROLLING
from strainfmu.estimator.signal_names import TEMPERATURE, THRUST
from strainfmu.interface.contents import estimator_contents

pytestmark = pytest.mark.fast

MOST = 3


@cache
def files_by_literal() -> Counter[str]:
    """Return the number of product files that hold each text as a whole literal; comments do not count."""
    found: Counter[str] = Counter()
    for room in ("strainfmu", "builder", "fmus"):
        for path in (ROOT / room).rglob("*.*"):
            if path.suffix == ".py":
                nodes = nodes_of(path.relative_to(ROOT))
                found.update(
                    {one.value for one in nodes if isinstance(one, ast.Constant) and isinstance(one.value, str)}
                )
            elif path.suffix in {".c", ".h", ".js", ".html"} and not {"binaries", "headers"} & set(path.parts):
                text = re.sub(
                    r"/\*.*?\*/|^\s*#include[^\n]*$", "", path.read_text(encoding="utf-8"), flags=re.S | re.M
                )
                found.update(
                    {double or single for double, single in re.findall(r'"([^"\\\n]*)"|\'([^\'\n]*)\'', text)}
                )
    return found


def test_few_files_hold_the_name_of_a_signal() -> None:
    whole = with_masses(with_temperature(with_sensors(with_further_tables(whole_map()))))
    names = [one["name"] for one in estimator_contents(whole)["signals"]]
    assert len(names) > 80
    assert {THRUST, TEMPERATURE, ROLLING, *INERTIAL_NAMES} < set(names)
    found = {name: files_by_literal()[name] for name in names}
    too_many = {name: count for name, count in found.items() if count > MOST}
    assert too_many == {}
