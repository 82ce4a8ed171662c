"""The reference of the command line, made from the commands' signatures: directive ``command-line``."""

from __future__ import annotations

import inspect
import re
import types
from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from generated_text import GeneratedText
from sphinx.application import Sphinx
from typer.models import ArgumentInfo

from strainfmu.cli.commands import program
from strainfmu.cli.commands.help_layout import COMMANDS, PAGES, public_functions


@dataclass(frozen=True, kw_only=True)
class Entry:
    """An argument or option of one command."""

    is_argument: bool
    names: tuple[str, ...]
    value: str
    default: str
    help: str


def command_page() -> str:
    """Return every command with its arguments and options, in MyST Markdown."""
    commands = [(command_name(info), info.callback) for info in program().registered_commands]
    of_name, overview = dict(commands), ["## Commands"]
    for panel, names in COMMANDS.items():
        overview += ["", f"**{panel}**", "", "| command | |", "|---|---|"]
        overview += [f"| [`{name}`](#command-{name}) | {_first_line(of_name[name])} |" for name in names]
    return "\n".join([*overview, "", *(_section(name, call) for name, call in commands)])


def command_name(info: Any) -> str:
    """Return the name that a command is called by."""
    return info.name or info.callback.__name__.replace("_", "-")


def entries(command: Callable[..., None]) -> list[Entry]:
    """Return arguments and options of a command in the order of its signature."""
    hints = get_type_hints(command, include_extras=True)
    return [_entry(parameter, hints[name]) for name, parameter in inspect.signature(command).parameters.items()]


def _entry(parameter: inspect.Parameter, hint: Any) -> Entry:
    kind, info = get_args(hint)[:2] if get_origin(hint) is Annotated else (hint, parameter.default)
    required = parameter.default is inspect.Parameter.empty or parameter.default is ...
    default = "required" if required else _default(parameter.default)
    if isinstance(info, ArgumentInfo):
        value = info.metavar or parameter.name.upper()
        return Entry(is_argument=True, names=(value,), value="", default=default, help=info.help or "")
    first = (info.default,) if isinstance(info.default, str) else ()  # of an annotated option: its first name
    declared = [name for names in (*first, *(info.param_decls or ())) for name in names.split("/")]
    names = tuple(declared) or _option_names(parameter.name, kind)
    value = "" if kind is bool else info.metavar or _value(kind)
    limits = _limits(info.min, info.max)
    return Entry(
        is_argument=False, names=names, value=value, default=default, help=" ".join([info.help or "", limits])
    )


def _option_names(name: str, kind: Any) -> tuple[str, ...]:
    option = f"--{name.replace('_', '-')}"
    return (option, f"--no-{option[2:]}") if kind is bool else (option,)


def _value(kind: Any) -> str:
    origin, given = get_origin(kind), [a for a in get_args(kind) if a is not types.NoneType]
    if origin is Literal:
        return "|".join(map(str, given))
    if origin in (Union, types.UnionType, list, Annotated):
        return _value(given[0])
    return {int: "INTEGER", float: "NUMBER", str: "TEXT", Path: "PATH"}.get(kind, str(kind))


def _limits(low: float | None, high: float | None) -> str:
    if low is None and high is None:
        return ""
    return f"From {low:g}." if high is None else f"At most {high:g}." if low is None else f"{low:g} to {high:g}."


def _default(value: Any) -> str:
    if value is None or value in ((), [], ""):
        return ""
    if isinstance(value, bool):
        return "on" if value else "off"
    return _code(str(value))


def _section(name: str, command: Callable[..., None]) -> str:
    listed = entries(command)
    usage = " ".join(entry.names[0] for entry in listed if entry.is_argument)
    lines = [f"(command-{name})=", f"## {name}", ""]
    lines += [f"```text\nstrainfmu {name} [OPTIONS] {usage}".rstrip() + "\n```", "", _prose(_help(command)), ""]
    called = ", ".join(f"`{function}`" for function in public_functions(name))
    lines += [f"In Python: {called}", ""]
    lines += [f"More: [{PAGES[name]}](../{PAGES[name].removeprefix('docs/')})", ""]
    for title, wanted in (("argument", True), ("option", False)):
        rows = [_row(entry) for entry in listed if entry.is_argument is wanted]
        if rows:
            lines += [f"| {title} | default | |", "|---|---|---|", *rows, ""]
    return "\n".join(lines)


def _row(entry: Entry) -> str:
    names = ", ".join(map(_code, entry.names)) + (f" {_code(entry.value)}" if entry.value else "")
    return f"| {names} | {entry.default} | {_cell(entry.help)} |"


def _help(command: Callable[..., None]) -> str:
    return (inspect.getdoc(command) or "").replace("\\[", "[")  # escaped for rich


def _prose(text: str) -> str:
    """Turn help text into Markdown: command lines one after the other become one block of code."""
    joined = [" ".join(block.split()) for block in re.split(r"\n\s*\n", text.replace("\b\n", ""))]
    blocks = []
    for is_code, group in groupby(joined, key=lambda block: block.startswith("strainfmu ")):
        if is_code:
            blocks.append("\n".join(["```text", *group, "```"]))
        else:
            blocks += map(_escape, group)
    return "\n\n".join(blocks)


def _first_line(command: Callable[..., None]) -> str:
    return _cell(_help(command).split("\n\n")[0])


def _cell(text: str) -> str:
    return _escape(" ".join(text.split())).replace("|", "\\|")


def _code(text: str) -> str:
    return f"`{text}`".replace("|", "\\|")


def _escape(text: str) -> str:
    """Escape what Markdown would read, outside code; options become code: two hyphens would become a dash."""
    parts = re.split(r"(`[^`]*`|(?<!\w)--[a-z][\w-]*)", text)
    code = {part: f"`{part.strip('`')}`" for part in parts[1::2]}
    return "".join(code.get(part) or re.sub(r"([<>*_\[\]$])", r"\\\1", part) for part in parts)


class CommandLine(GeneratedText):
    """Every command, its arguments and its options."""

    source = "strainfmu.cli.commands"

    def text(self) -> str:
        """Return the page."""
        return command_page()


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("command-line", CommandLine)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
