"""Every result that the source publishes as a number, and where: the rows of ``published.csv``.

Source: Pham, Ghattas, Clemens and Willcox, "Real-time aerodynamic load estimation for hypersonics via strain-based
inverse maps", arXiv 2408.15286.
"""

import csv
import json
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class Published:
    """One published number, or a range of them.

    Attributes
    ----------
    key : its name in comparisons.
    quantity : description.
    value : as published, with unit.
    location : section, table or figure of the source.
    low, high : the number, or both ends of the range, in the unit of ``unit``; None where only one end is given.
    unit : "%" or "1".
    """

    key: str
    quantity: str
    value: str
    location: str
    low: float | None
    high: float | None
    unit: str


def _read(path: Path) -> dict[str, Published]:
    """Return the rows of a CSV file by key; an integer stays one, an empty cell is no number."""
    published: dict[str, Published] = {}
    with path.open(newline="", encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            low, high = (json.loads(row.pop(end) or "null") for end in ("low", "high"))
            published[row["key"]] = Published(**row, low=low, high=high)
    return published


PUBLISHED = _read(Path(__file__).with_name("published.csv"))
"""By key, in the order of the source."""
