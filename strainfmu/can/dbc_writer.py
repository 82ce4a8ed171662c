"""The DBC file of a profile: input and result frames, with CAN FD flags and E2E protection as attributes."""

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any

from strainfmu.can.dbc_files import E2E_DATA_ID, E2E_PROFILE, SECOC_DATA_ID
from strainfmu.can.frame import import_cantools
from strainfmu.can.frame_layout import FLOAT, LITTLE, SIGNED, FrameLayout, SignalLayout
from strainfmu.can.profiles import BRIDGE, SENDER


def dbc_text(layouts: Sequence[FrameLayout], comment: str) -> str:
    """Return the DBC file of ``layouts``; ``comment`` names its source."""
    import_cantools()
    from cantools.database import load_string
    from cantools.database.can import Database, Node
    from cantools.database.can.formats.dbc.dbc_specifics import DbcSpecifics

    definitions = _definitions()
    if all(layout.secured is None for layout in layouts):
        del definitions[SECOC_DATA_ID]
    attributes = OrderedDict()
    if any(layout.is_fd for layout in layouts):
        # Without this attribute cantools writes a DBC file whose frames are all classic.
        attributes["BusType"] = _attribute("CAN FD", definitions["BusType"])
    database = Database(
        [_message(layout, definitions) for layout in layouts],
        [Node(SENDER, f"Sends strains: {comment}"), Node(BRIDGE, f"strainfmu bridge: {comment}")],
        version="",
        dbc_specifics=DbcSpecifics(attributes=attributes, attribute_definitions=definitions),
    )
    # Read back once: the file is then a fixed point of cantools and certain to load.
    loaded: Any = load_string(database.as_dbc_string(), database_format="dbc")
    return str(loaded.as_dbc_string())


def _definitions() -> OrderedDict[str, Any]:
    """Return the definitions of the attributes used."""
    from cantools.database.can.formats.dbc.dbc_attribute_definition import DbcAttributeDefinition

    definitions = OrderedDict(BusType=DbcAttributeDefinition("BusType", "CAN", type_name="STRING"))
    ranges: dict[str, tuple[Any, int]] = {
        E2E_PROFILE: (0, 22),
        E2E_DATA_ID: (0, 65535),
        SECOC_DATA_ID: (-1, 65535),
    }
    for name, (low, high) in ranges.items():
        definitions[name] = DbcAttributeDefinition(
            name, low, kind="BO_", type_name="INT", minimum=low, maximum=high
        )
    return definitions


def _attribute(value: object, definition: Any) -> Any:
    from cantools.database.can.formats.dbc.dbc_attribute import DbcAttribute

    return DbcAttribute(value=value, definition=definition)


def _message(layout: FrameLayout, definitions: OrderedDict[str, Any]) -> Any:
    """Return cantools' message of ``layout``."""
    from cantools.database.can import Message
    from cantools.database.can.formats.dbc.dbc_specifics import DbcSpecifics

    attributes: OrderedDict[str, Any] = OrderedDict()
    if layout.protection is not None:
        attributes[E2E_PROFILE] = _attribute(layout.protection.profile, definitions[E2E_PROFILE])
        attributes[E2E_DATA_ID] = _attribute(layout.protection.data_id, definitions[E2E_DATA_ID])
    if layout.secured is not None:
        attributes[SECOC_DATA_ID] = _attribute(layout.secured.data_id, definitions[SECOC_DATA_ID])
    receiver = SENDER if layout.sender == BRIDGE else BRIDGE
    return Message(
        frame_id=layout.identifier,
        name=layout.name,
        length=layout.length,
        signals=[_signal(signal, receiver) for signal in layout.signals],
        comment=layout.comment or None,
        senders=[layout.sender],
        cycle_time=None if layout.cycle_time is None else max(round(1e3 * layout.cycle_time), 1),
        is_extended_frame=layout.is_extended,
        is_fd=layout.is_fd,
        dbc_specifics=DbcSpecifics(attributes=attributes, attribute_definitions=definitions),
        strict=True,
    )


def _signal(signal: SignalLayout, receiver: str) -> Any:
    """Return cantools' signal of ``signal``."""
    from cantools.database.can import Signal
    from cantools.database.conversion import BaseConversion

    choices: OrderedDict[int, Any] = OrderedDict(signal.choices)
    if signal.not_available is not None and not choices:
        choices[signal.not_available] = "NotAvailable"
    return Signal(
        name=signal.name,
        start=signal.start,
        length=signal.length,
        byte_order="little_endian" if signal.byte_order == LITTLE else "big_endian",
        is_signed=signal.kind in (SIGNED, FLOAT),
        raw_initial=signal.initial,
        conversion=BaseConversion.factory(
            scale=_plain(signal.scale),
            offset=_plain(signal.offset),
            choices=choices or None,
            is_float=signal.kind == FLOAT,
        ),
        minimum=signal.minimum,
        maximum=signal.maximum,
        unit=signal.unit or None,
        comment=signal.comment or None,
        receivers=[receiver],
    )


def _plain(number: float) -> float | int:
    """Return whole numbers as int: DBC tools and cantools keep 1 and 1.0 apart."""
    return int(number) if number == int(number) else number
