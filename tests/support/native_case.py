"""A map and the resources of a native FMU made of it."""

from dataclasses import dataclass
from pathlib import Path

from strainfmu.estimator.map.inverse_map import InverseMap


@dataclass(frozen=True)
class NativeCase:
    """A map and the folder of resources that holds it."""

    inverse_map: InverseMap
    resources: Path

    @property
    def n(self) -> int:
        """Number of gauges."""
        return self.inverse_map.n_gauges

    @property
    def uri(self) -> str:
        """The folder as FMI 2.0 has it."""
        return self.resources.as_uri()
