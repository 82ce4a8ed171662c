"""One table of health, in C: names and order in Python and in the documentation are the table's."""

import re
from itertools import groupby
from pathlib import Path

import pytest

from strainfmu.estimator.health import HealthState
from strainfmu.interface.enumerations import HEALTH_ITEMS

pytestmark = pytest.mark.fast

ROOT = Path(__file__).parents[2]
ESTIMATOR = ROOT / "fmus" / "native" / "estimator"
OUTPUTS = (ESTIMATOR / "sample" / "sample.h").read_text("utf-8")
ROWS = re.findall(r"^    X\(([A-Z_]+), ([A-Z_]+)\)", OUTPUTS, re.MULTILINE)


def test_names_are_those_of_python() -> None:
    states = [state.name for state in HealthState]
    names = re.search(r"HEALTH_NAMES\[\] = \{([^}]*)\}", (ESTIMATOR / "sample" / "health.c").read_text("utf-8"))
    numbers = re.search(r"enum \{ (OK, [^}]*) \}", OUTPUTS)
    assert names is not None
    assert numbers is not None
    assert re.findall(r"\w+", names[1]) == states == numbers[1].split(", ")
    assert [state for state, _ in HEALTH_ITEMS] == list(HealthState)


def test_every_condition_has_one_row() -> None:
    assert len({condition for condition, _ in ROWS}) == len(ROWS)
    assert {state for _, state in ROWS} == {state.name for state in HealthState} - {"OK"}


def test_documentation_has_the_order_of_the_table() -> None:
    page = (ROOT / "docs" / "explanation" / "envelope.md").read_text("utf-8")
    table = page.partition("## What is compared")[2].partition("\nIn the linear estimator")[0]
    stated = re.findall(r"\| `([A-Z_]+)` \|$", table, re.MULTILINE)
    assert stated == [state for state, _ in groupby(state for _, state in ROWS)] + ["OK"]


def test_one_line_of_c_sets_the_output() -> None:
    setting = r"\[HEALTH_STATE\]\s*=[^=]"
    files = [file.name for file in ESTIMATOR.rglob("*.c") for _ in re.findall(setting, file.read_text("utf-8"))]
    assert files == ["estimator.c"]
