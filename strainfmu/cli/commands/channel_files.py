"""The channel file of a recording: ``strainfmu channels``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console


def channels(
    source: Annotated[Path, typer.Argument(metavar="MAP", help="Inverse map (map.h5), or estimator FMU.")],
    data: Annotated[Path, typer.Argument(metavar="DATA", help="CSV, HDF5, MF4, TDMS, MAT or Parquet.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Channel file to write (TOML).")] = Path(
        "channels.toml"
    ),
) -> None:
    """Propose which channel of a recording is which gauge, in a file to check and correct.

    Each gauge of the map gets the channel of its name or number, or the channel with the nearest name. Units are
    taken from the recording. A file that is there is never overwritten.

    Examples:

        strainfmu channels map.h5 recorder.tdms -o channels.toml

        strainfmu estimate map.h5 recorder.tdms -o loads.csv --channels channels.toml
    """
    from strainfmu.recorded.channel_draft import write_draft

    draft = write_draft(source, data, output)
    lines = [f"{output}: written; {draft.summary()}"]
    if draft.missing:
        shown = ", ".join(draft.missing[:6]) + (" .." if len(draft.missing) > 6 else "")
        lines.append(f"without a channel: {shown}")
    lines.append(f"check it, then: strainfmu estimate {source} {data} -o loads.csv --channels {output}")
    for line in lines:
        Console().print(line, highlight=False, markup=False, soft_wrap=True)
