"""The layout of ``map.bin``: the header for C is of the schema, and a value has one place."""

import pytest

from strainfmu.estimator.resource.map_file import LAYOUT
from strainfmu.fmu.native.map_layout import HEADER, header

pytestmark = pytest.mark.fast


def test_the_header_for_c_is_of_the_schema() -> None:
    assert HEADER.read_text(encoding="utf-8") == header(), "python -m strainfmu.fmu.native.map_layout"


def test_each_array_has_one_place_and_a_meaning() -> None:
    places = [one.place for one in LAYOUT]
    assert len(set(places)) == len(places)
    assert all(one.meaning for one in LAYOUT)
