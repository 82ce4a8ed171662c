"""Readings of the gauge layout: the positions that the source's text leaves open.

The text gives nine gauges a row, 18 axial and 9 hoop in Configuration 1 and their mirror images in 2.
That is consistent if two rows, one in the xz-plane and one in the xy-plane, hold axial gauges and one of them hoop
gauges as well. Which sides, which row, and where the rows begin and end is shown in a figure only.
"""

from dataclasses import dataclass

from builder.vehicle.file import Vehicle
from builder.vehicle.gauges.gauge_entries import GaugeLayoutEntry, GaugeRow

GAUGES_PER_ROW = 9
ALL = "all"


@dataclass(frozen=True)
class Reading:
    """One reading of the layout.

    Attributes
    ----------
    z_row, y_row : roll angle [deg] of Configuration 1's row in the xz- and in the xy-plane; 180 and 90 are
        windward at positive angle of attack and sideslip.
    hoop : row that holds the hoop gauges, "z" or "y".
    """

    z_row: int
    y_row: int
    hoop: str

    @property
    def name(self) -> str:
        """Sides and hoop row in words."""
        z = "windward" if self.z_row == 180 else "leeward"
        y = "windward" if self.y_row == 90 else "leeward"
        return f"z row {z}, y row {y}, hoop on the {self.hoop} row"

    def configuration(self, number: int) -> list[str]:
        """Return the gauges' names of Configuration 1 or 2."""
        z_rows = [self.z_row] if number == 1 else [self.z_row, (self.z_row + 180) % 360]
        y_rows = [self.y_row] if number == 1 else [self.y_row, (self.y_row + 180) % 360]
        hoop_rows = z_rows if self.hoop == "z" else y_rows
        return [name for roll in (*z_rows, *y_rows) for name in _row("axial", roll)] + [
            name for roll in hoop_rows for name in _row("hoop", roll)
        ]


READINGS = tuple(Reading(z, y, hoop) for hoop in ("z", "y") for z in (180, 0) for y in (90, 270))
"""All eight readings."""

SHIPPED = Reading(180, 90, "z")
"""The reading of the shipped vehicle file."""

SPANS = {"0.35 to 3.30 m (shipped)": (0.35, 3.30), "0.20 to 3.40 m": (0.20, 3.40), "0.50 to 3.20 m": (0.50, 3.20)}
"""First and last station of the rows, which the source does not give."""


def _row(kind: str, roll: int) -> list[str]:
    return [f"{kind}_{roll}deg_{i}" for i in range(1, GAUGES_PER_ROW + 1)]


def gauges_of_45(vehicle: Vehicle) -> list[str]:
    """Return the names of the layout "45": axial rows as published, hoop gauges between the planes."""
    rows = vehicle.gauges.layouts["configuration_45"].rows or []
    return [
        f"{kind}_{row.roll_angle_deg:g}deg_{i}"
        for row in rows
        for kind in row.directions
        for i in range(1, len(row.stations) + 1)
    ]


def with_all_gauges(vehicle: Vehicle, span: tuple[float, float] | None = None) -> Vehicle:
    """Return the vehicle with layouts that hold every gauge of every reading, and the hoop gauges of "45".

    Parameters
    ----------
    span : first and last station [m] of the rows; by default the vehicle file's.
    """
    layouts = vehicle.gauges.layouts
    shipped = (layouts["configuration_2"].rows or [])[0]
    first, last = span or (shipped.stations[0], shipped.stations[-1])
    rows = [
        GaugeRow(
            roll_angle_deg=float(roll),
            directions=["axial", "hoop"],
            first_x_m=first,
            last_x_m=last,
            count=GAUGES_PER_ROW,
        )
        for roll in (0, 90, 180, 270)
    ]
    between = [row for row in layouts["configuration_45"].rows or [] if row.roll_angle_deg % 90.0]
    entry = {ALL: GaugeLayoutEntry(rows=rows + between)}
    return vehicle.model_copy(
        update={
            "gauges": vehicle.gauges.model_copy(update={"layouts": entry, "layout": ALL}),
            # The noise of the readings is the protocol's own: the layout of the file's is not among these.
            "noise": vehicle.noise.model_copy(update={"of_layout": None}),
        }
    )
