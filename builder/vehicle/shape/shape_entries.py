"""Sections [shape] and [reference] of the vehicle file: a profile, sections along x, or any closed surface.

Reference area, length and moment point of the coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, model_validator

from builder.vehicle.shape.profile_entries import Piece
from builder.vehicle.toml.toml_sections import FileName, Section, Station


@dataclass(frozen=True)
class ReferenceQuantities:
    """What coefficients are referred to: S [m2], L [m] and the moment point on the axis [m from the tip]."""

    area: float
    length: float
    moment_station: float


KINDS = ("profile", "sections", "surface")


class Shape(Section):
    """The outer shape; exactly one of ``profile``, ``sections`` and ``surface``.

    ``sections`` is a CSV file of superelliptic sections, joined along x by ``interpolation``. ``surface`` is a
    file of triangles, closed or open at its base alone; its length unit is ``unit``, or follows from ``length_m``.
    """

    profile: list[Annotated[Piece, Field(discriminator="kind")]] | None = Field(default=None, min_length=1)
    sections: FileName | None = None
    interpolation: Literal["linear", "monotone"] = "linear"
    surface: FileName | None = None
    unit: Literal["m", "mm", "cm", "in", "ft"] | None = None
    length_m: Station | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Shape:
        kinds = [name for name in KINDS if getattr(self, name) is not None]
        if len(kinds) != 1:
            raise ValueError(f"expected one of {', '.join(KINDS)}, got {' and '.join(kinds) or 'none'}")
        if self.surface is not None and self.unit is None and self.length_m is None:
            raise ValueError(
                "surface: expected unit or length_m with it, got neither; files of triangles hold no unit"
            )
        if self.surface is None and (self.unit is not None or self.length_m is not None):
            raise ValueError("unit, length_m: expected with surface alone")
        if self.sections is None and self.interpolation != "linear":
            raise ValueError("interpolation: expected with sections alone")
        return self

    @property
    def kind(self) -> str:
        """Which of :data:`KINDS` it is."""
        return next(name for name in KINDS if getattr(self, name) is not None)


class Reference(Section):
    """Reference quantities of the coefficients; area and length default to base area and base diameter."""

    area_m2: float | None = Field(default=None, ge=1e-6, le=1e6)
    length_m: Station | None = None
    moment_station_m: float = Field(ge=-1e3, le=1e3)
