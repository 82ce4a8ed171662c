"""The page of the rooms: every file has a room, and none grows without a word."""

import pytest
from rooms import MEASURES, PAGE, ROOT, TREES, lines_of_rooms, rows

pytestmark = pytest.mark.fast

GROWTH = 0.03
"""By which a room may be larger than its figure."""
AGAIN = "or write the figures of today by `python tests/support/rooms.py --write`, with the reason in the commit"


def number(text: str) -> float:
    return float(text.replace(",", ""))


def test_every_file_has_a_room_and_every_room_files() -> None:
    lines = lines_of_rooms(frozenset(row.name for row in rows("Rooms")))
    assert lines[None] == 0
    assert [name for name, count in lines.items() if count == 0 and name is not None] == []


def test_no_room_is_larger_than_its_figure() -> None:
    table = rows("Rooms")
    lines = lines_of_rooms(frozenset(row.name for row in table))
    large = [
        f"{row.name}: {lines[row.name]:,} lines, {row.cells[1]} stated"
        for row in table
        if lines[row.name] > (1.0 + GROWTH) * number(row.cells[1])
    ]
    assert large == [], f"{PAGE.name}: say something once that is said twice, {AGAIN}"


@pytest.mark.parametrize("measure", MEASURES)
def test_measures_only_fall(measure: str) -> None:
    (row,) = [row for row in rows("Measures") if row.name == measure]
    for tree, stated in zip(TREES[:2], row.cells, strict=True):
        found = MEASURES[measure](tree)
        assert found <= number(stated) * 1.005 + 0.5 * (number(stated) > 20), (
            f"{tree}, {measure}: {found:.4g}, {stated} stated in {PAGE.name}: {AGAIN}"
        )


def test_no_two_modules_of_builder_have_one_name() -> None:
    names = [path.stem for path in (ROOT / "builder").rglob("*.py") if path.stem != "__init__"]
    assert sorted(name for name in set(names) if names.count(name) > 1) == []


def test_places_are_where_the_page_says() -> None:
    for row in rows("Places"):
        path, text = row.cells[0].strip("`"), row.cells[1].strip("`")
        assert text in (ROOT / path).read_text("utf-8"), f"{row.name}: {text!r} is not in {path}"
