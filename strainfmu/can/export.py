"""Export of an estimator: as an FMU, on a CAN bus or not, or as C sources."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Literal

from strainfmu.fmu.export import ExportOptions, export_estimator


def export(
    inverse_map: str | PathLike[str],
    output: str | PathLike[str] = "estimator.fmu",
    *,
    kind: str = "native",
    fmi: str | int = "2",
    scalars: bool = False,
    platforms: Sequence[str] | Literal["all"] = "all",
    bus: str | PathLike[str] | None = None,
    inputs: str = "minimal",
    estimator: Literal["linear"] | None = None,
    zero_inputs: bool = False,
    tare_known: str | PathLike[str] | None = None,
) -> Literal["linear", "nonlinear"]:
    """Write the estimator FMU of a map, or a new folder of C sources; return which estimator it holds.

    Parameters
    ----------
    inverse_map : file of the map.
    output : FMU to write; folder of kind "c".
    kind, scalars, platforms, inputs, estimator, zero_inputs, tare_known : as :class:`ExportOptions` has them.
    fmi : version of FMI, 2 or, native only, 3.
    bus : bus file of an FMU of FMI 3.0 whose strains and results are CAN frames (FMI-LS-BUS); None for none.

    Raises
    ------
    InputError, StrainfmuError
        As :func:`export_estimator`; or the bus file is wrong.
    """
    options = ExportOptions(
        kind=kind,
        fmi_version=str(fmi).removesuffix(".0"),
        scalars=scalars,
        platforms=None if platforms == "all" else platforms,
        inputs=inputs,
        estimator=estimator,
        zero_inputs=zero_inputs,
        tare_known=None if tare_known is None else Path(tare_known),
    )
    if bus is None:
        return export_estimator(inverse_map, output, options)
    from strainfmu.can.ecu import export_ecu

    return export_ecu(Path(inverse_map), Path(output), Path(bus), options)
