"""Section [material] of the vehicle file."""

from __future__ import annotations

from pydantic import Field

from builder.vehicle.toml.toml_sections import Section


class MaterialEntry(Section):
    """Isotropic linear elasticity."""

    youngs_modulus_GPa: float = Field(ge=0.1, le=2e3)
    poisson_ratio: float = Field(ge=0.0, le=0.499)
    density_kg_per_m3: float | None = Field(default=None, ge=10.0, le=3e4)
