"""Options that all commands of the bus share, checked before anything is opened."""

from __future__ import annotations

from collections.abc import Iterable

from strainfmu.errors import InputError

_ENTRIES = {
    "--dbc": "input.dbc",
    "--mapping": "input.mapping",
    "--cycle-time": "input.cycle_time_ms",
    "--id-base": "input.id_base",
    "--result-base": "results.id_base",
    "--extended": "input.extended",
    "--key": "input.key",
    "--freshness": "input.freshness",
    "--dynamic-pressure": "input.dynamic_pressure_pa",
    "--result": "results.form",
    "--stuck-cycles": "trust.stuck_cycles",
    "--max-age": "trust.max_age_cycles",
    "--clock-tolerance": "clock.tolerance_ppm",
    "--synchronised": "clock.synchronised_ms",
    "--publish": "page.publish",
    "--publish-rate": "page.rate_hz",
    "--publish-field": "page.field",
    "--zeros": "zeros.file",
    "--tare": "tare.map",
    "--tare-cycles": "tare.cycles",
    "--tare-known": "tare.known",
    "--tare-output": "tare.output",
    "--tare-at": "tare.at_s",
}
"""The entry of the bus file that replaces an option."""

OLD_OPTIONS = dict.fromkeys(("bridge", "dbc", "replay", "send"), _ENTRIES)
"""Options that commands had, and the entry of the bus file that replaces each."""

OLD_SOURCES = {"--data": "the argument DATA", "--scenario": "the argument DATA", "--files": "the folder of --map"}
"""Options that ``send`` had, and what replaces each."""


def refuse_old_options(command: str, arguments: Iterable[str]) -> None:
    """Refuse an option that is an entry of the bus file by now.

    Raises
    ------
    InputError
        There is one; the message has the entry.
    """
    for argument in arguments:
        option = argument.partition("=")[0]
        entry = OLD_OPTIONS.get(command, {}).get(option)
        if entry is not None:
            table, _, name = entry.partition(".")
            raise InputError(
                f"{option}: state it as entry {name} of [{table}] in the bus file, or by --set {entry}=VALUE"
            )
        if command == "send" and option in OLD_SOURCES:
            raise InputError(f"{option}: is replaced by {OLD_SOURCES[option]}: strainfmu send DATA --map map.h5")
