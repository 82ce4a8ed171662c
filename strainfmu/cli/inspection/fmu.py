"""Inspection of an FMU, of this project's and any other: ``strainfmu inspect X.fmu``."""

from pathlib import Path
from typing import Any

from rich.console import Console

from strainfmu.errors import FaultsError
from strainfmu.fmu.checks.contents import read_fmu
from strainfmu.fmu.checks.integrity import damaged_entries


def inspect_fmu(path: Path, console: Console) -> None:
    """Show kind, FMI version, platforms, guid, map, validity, variables and files of the FMU at ``path``.

    Raises
    ------
    InputError
        The FMU is missing or damaged. Where a check sum in it is wrong, after all that it states has been shown.
    """
    description, contents, files = read_fmu(path)
    kinds = {
        "model exchange": description.modelExchange,
        "co-simulation": description.coSimulation,
        "scheduled execution": getattr(description, "scheduledExecution", None),
    }
    platforms = sorted(
        {name.split("/")[1] for name in files if name.startswith("binaries/") and name.count("/") > 1}
    )
    rows = {
        "description": description.description,
        "FMI": f"{description.fmiVersion}, {', '.join(k for k, section in kinds.items() if section is not None)}",
        "kind": contents.get("kind"),
        "platforms": ", ".join(platforms) or "none: sources only",
        "guid": description.guid,
        "map": contents.get("map"),
        "flight model": contents.get("flight_model"),
        "vehicle": contents.get("vehicle"),
        "made by": description.generationTool,
        "at": description.generationDateAndTime,
        "size": f"{path.stat().st_size / 1024:.1f} KiB in {len(files)} files",
        **contents.get("validity", {}),
    }
    lines = [f"{path}: {description.modelName}"]
    lines += [f"  {name:<14} {text}" for name, text in rows.items() if text]
    lines += ["", *_variable_lines(description), "", f"{len(files)} files, bytes:"]
    lines += [f"{size:>10,}  {name}" for name, size in sorted(files.items())]
    # Never narrowed to the terminal, so that lines can be searched for.
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    damage = damaged_entries(path)
    if damage:
        raise FaultsError("\n".join(f"{path}: {line}" for line in damage))


def _variable_lines(description: Any) -> list[str]:
    """Return the table of variables; an array in one line."""
    rows = [("no.", "name", "type", "causality", "unit", "start", "description")]
    for variable in description.modelVariables:
        size = "".join(f"[{d.start or d.valueReference}]" for d in variable.dimensions or [])
        declared = variable.declaredType
        start = str(variable.start or "").split()
        rows.append(
            (
                str(variable.valueReference),
                f"{variable.name}{size}",
                declared.name if declared is not None and variable.type == "Enumeration" else variable.type,
                f"{variable.variability} {variable.causality}",
                variable.unit or (declared.unit if declared is not None else "") or "",
                f"{start[0]} .." if len(start) > 1 else "".join(start),
                variable.description or "",
            )
        )
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]) - 1)]
    lines = [f"{len(rows) - 1} variables:"]
    for number, *texts, last in rows:
        cells = (f"{text:<{width}}" for text, width in zip(texts, widths[1:], strict=True))
        lines.append(f"  {number:>{widths[0]}}  {'  '.join(cells)}  {last}")
    return lines
