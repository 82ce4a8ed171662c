"""Where Nastran keeps strain in the words of an element: rods, plates, composite plies, solids.

Words are numbered from 0, the element's number first, as OP2 and punch files both list them (MSC Nastran, "DMAP
Programmer's Guide", data block OES). Shear strain is the engineering one, gamma, everywhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray, IntArray

ROD, PLATE, PLY, SOLID = "rod", "plate", "ply", "solid"

CURVATURE = -1.0
"""Fibre distance of a plate's second side where the file holds strain and curvature of the middle surface."""


@dataclass(frozen=True, kw_only=True)
class ElementLayout:
    """The words of one type of element.

    Attributes
    ----------
    name : of the element.
    kind : one of :data:`ROD`, :data:`PLATE`, :data:`PLY`, :data:`SOLID`.
    words : words of an element, or of one of its plies.
    first, step, points : words ahead of the first point, words of a point, number of points, the centre first.
    """

    name: str
    kind: str
    words: int
    first: int = 1
    step: int = 0
    points: int = 1

    @property
    def has_nodes(self) -> bool:
        """Whether each point begins with the number of its node, 0 or the count of nodes at the centre."""
        return self.kind == SOLID or self.points > 1

    @property
    def integers(self) -> list[int]:
        """Words that are integers: element, coordinate system of solids, ply, node of each point."""
        of_kind = {SOLID: [0, 1, 3], PLY: [0, 1]}.get(self.kind, [0])
        return of_kind + [self.first + self.step * k for k in range(self.points) if self.has_nodes]


def _plate(name: str, points: int = 1) -> ElementLayout:
    if points == 1:
        return ElementLayout(name=name, kind=PLATE, words=17, first=1, step=16)
    return ElementLayout(name=name, kind=PLATE, words=2 + 17 * points, first=2, step=17, points=points)


def _solid(name: str, nodes: int) -> ElementLayout:
    return ElementLayout(name=name, kind=SOLID, words=4 + 21 * (nodes + 1), first=4, step=21, points=nodes + 1)


LAYOUTS = {
    1: ElementLayout(name="CROD", kind=ROD, words=5),
    3: ElementLayout(name="CTUBE", kind=ROD, words=5),
    10: ElementLayout(name="CONROD", kind=ROD, words=5),
    33: _plate("CQUAD4"),
    39: _solid("CTETRA", 4),
    64: _plate("CQUAD8", 5),
    67: _solid("CHEXA", 8),
    68: _solid("CPENTA", 6),
    70: _plate("CTRIAR", 4),
    74: _plate("CTRIA3"),
    75: _plate("CTRIA6", 4),
    82: _plate("CQUADR", 5),
    95: ElementLayout(name="CQUAD4 of plies", kind=PLY, words=11),
    96: ElementLayout(name="CQUAD8 of plies", kind=PLY, words=11),
    97: ElementLayout(name="CTRIA3 of plies", kind=PLY, words=11),
    98: ElementLayout(name="CTRIA6 of plies", kind=PLY, words=11),
    144: _plate("CQUAD4 with corners", 5),
    255: _solid("CPYRAM", 5),
}
"""By Nastran's number of the type of element."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ElementRows:
    """Strains of elements of one type in one subcase.

    Attributes
    ----------
    subcase, element_type : Nastran's numbers.
    words : (m, w) words of each element or ply, integers among them as numbers; text is NaN. Empty where the type
        is none of :data:`LAYOUTS`.
    element : (m,) number of the element of each row.
    """

    subcase: int
    element_type: int
    words: FloatArray
    element: IntArray

    @property
    def layout(self) -> ElementLayout | None:
        return LAYOUTS.get(self.element_type)


def known_rows(subcase: int, element_type: int, words: FloatArray) -> ElementRows:
    """Return rows whose first word is the element's number."""
    return ElementRows(
        subcase=subcase,
        element_type=element_type,
        words=words,
        element=words[:, 0].astype(np.int64),
    )


def plate_strain(words: FloatArray, start: int, side: str) -> FloatArray:
    """Return (3,) strain x, y and gamma xy of the side ``z1`` or ``z2`` of a point that begins at ``start``."""
    first = start + (1 if side == "z1" else 9)
    return words[first : first + 3]


def solid_strain(words: FloatArray, start: int) -> FloatArray:
    """Return (6,) strain x, y, z, gamma xy, yz, zx of a point that begins at word ``start``, its node's."""
    return words[[start + k for k in (1, 9, 15, 2, 10, 16)]]


def along(strain: Sequence[float] | FloatArray, direction: FloatArray) -> float:
    """Return the strain along ``direction`` (2,) or (3,), of (3,) plane or (6,) components in the same axes."""
    unit = direction / np.linalg.norm(direction)
    pairs = [(0, 1)] if len(unit) == 2 else [(0, 1), (1, 2), (2, 0)]
    shear = [unit[i] * unit[j] for i, j in pairs]
    return float(np.concatenate([unit**2, shear]) @ np.asarray(strain))
