"""Options of a command, from its public functions: signature and docstring say all that both have in common.

They are read from the source, so that a help text imports nothing that computes. What a signature does not say is
in :mod:`~strainfmu.cli.commands.spellings`.
"""

import ast
import inspect
import math
import re
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import typer

from strainfmu.cli.commands.help_layout import public_functions
from strainfmu.cli.commands.spellings import FLAGS, NO_OPTIONS, Spelling, spelling
from strainfmu.public_names import public_names

REQUIRED = inspect.Parameter.empty


class _NoOption:
    """Type of what no text can stand for."""

    def __class_getitem__(cls, _: Any) -> type:
        return cls


class _Names(dict[str, Any]):
    """Names that signatures use; all others are types of no option."""

    def __missing__(self, name: str) -> Any:
        return getattr(__import__("builtins"), name, _NoOption)


NAMES = _Names(
    {
        "File": Path,
        "Literal": Literal,
        "Mapping": Mapping,
        "Path": Path,
        "PathLike": PathLike,
        "Sequence": Sequence,
        **vars(math),
    }
)


@dataclass(frozen=True, kw_only=True)
class Keyword:
    """A parameter of a public function: its type as an option, default, and description; None for no option."""

    name: str
    kind: Any
    default: Any
    text: str


@cache
def source(function: str) -> ast.FunctionDef:
    """Return a public function, such as ``strainfmu.bridge``, up to its docstring, as its file has it."""
    package, _, name = function.partition(".")
    root = Path(str(import_module(package).__file__)).parent
    parts = public_names(package)[name].split(".")[1:]
    path = root.joinpath(*parts).with_suffix(".py")
    definition = re.search(rf'^def {name}\(.*?^    """.*?"""$', path.read_text("utf-8"), re.M | re.S)
    assert definition is not None, function
    node = ast.parse(definition[0]).body[0]
    assert isinstance(node, ast.FunctionDef)
    return node


@cache
def keywords(function: str) -> dict[str, Keyword]:
    """Return the parameters of a public function that can be options."""
    node = source(function)
    arguments, doc = node.args, ast.get_docstring(node) or ""
    named = arguments.args + arguments.kwonlyargs
    required = [None] * (len(arguments.args) - len(arguments.defaults))
    defaults = [*required, *arguments.defaults, *arguments.kw_defaults]
    texts = _descriptions(doc)
    kinds = {argument.arg: _kind(_value(argument.annotation)) for argument in named}
    return {
        argument.arg: Keyword(
            name=argument.arg,
            kind=kinds[argument.arg],
            default=REQUIRED if default is None else _value(default),
            text=_followed(function, argument.arg, texts.get(argument.arg), doc),
        )
        for argument, default in zip(named, defaults, strict=True)
        if kinds[argument.arg] is not None
    }


def _value(node: ast.expr | None) -> Any:
    """Return the value of an annotation or a default."""
    return eval(compile(ast.Expression(node or ast.Constant(None)), "signature", "eval"), {}, NAMES)


def _kind(annotation: Any) -> Any:
    """Return the type of an option: of a union, the one that a text stands for best; None for no option."""
    is_union = get_origin(annotation) in (Union, types.UnionType)
    parts = [part for part in (get_args(annotation) if is_union else (annotation,)) if part is not types.NoneType]
    if any(part is Path or get_origin(part) is PathLike for part in parts):
        return Path
    for part in parts:
        if get_origin(part) is Literal:
            return Literal[tuple(value for value in get_args(part) if isinstance(value, str))]
        if get_origin(part) in (Sequence, Mapping, tuple):
            return list[str]
        if part in (bool, int, float, str):
            return part
    return None


def _descriptions(doc: str) -> dict[str, str]:
    """Return the description of each name in the section "Parameters" of a docstring."""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=\n\n|\Z)", doc, re.M | re.S)
    entries = [entry.partition(" : ") for entry in re.split(r"\n(?! )", section[1] if section else "")]
    return {name: " ".join(text.split()) for names, _, text in entries for name in names.split(", ")}


def _followed(function: str, name: str, text: str | None, doc: str) -> str:
    """Return a description; where it refers to another function, as that function describes it."""
    reference = re.search(r"as :func:`(\w+)` takes", doc if text is None else text)
    if reference is None:
        return text or ""
    keyword = keywords(f"{function.partition('.')[0]}.{reference[1]}").get(name)
    return "" if keyword is None else keyword.text


def command_function(name: str, run: Callable[..., None], *, with_options: bool = True) -> Callable[..., None]:
    """Return ``run`` with the signature and the help of a command, as its public functions describe them."""
    options = _options(name) if with_options else {}
    spelled = {option: spelling(name, option) for option in options}
    names = {option: spelled[option].option(option) for option in options}
    names |= {option: option.upper() for option in options if spelled[option].is_argument}

    def called(**values: Any) -> None:
        run(**{option: options[option].default if value is None else value for option, value in values.items()})

    called.__name__ = name
    called.__doc__ = _help(ast.get_docstring(source(public_functions(name)[0])) or "", names)
    parameters = [_parameter(option, spelled[option.name], names) for option in options.values()]
    # typer reads the attribute, which the type of functions does not list.
    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {option.name: option.annotation for option in parameters}
    return called


def _options(command: str) -> dict[str, Keyword]:
    """Return the options of a command: of its first function, then what others add, then flags of its own."""
    first, *further = public_functions(command)
    options = dict(keywords(first))
    for function in further:
        for name, option in keywords(function).items():
            options.setdefault(name, replace(option, default=None) if option.default is REQUIRED else option)
    for name, (default, text) in FLAGS.get(command, {}).items():
        options[name] = Keyword(name=name, kind=bool, default=default, text=text)
    return {name: option for name, option in options.items() if name not in NO_OPTIONS.get(command, ())}


def _parameter(keyword: Keyword, spelled: Spelling, names: Mapping[str, str]) -> inspect.Parameter:
    """Return the parameter that typer makes an option or an argument of."""
    name, default, kind = keyword.name, keyword.default, keyword.kind
    text = _plain(keyword.text, names)
    if spelled.unit:
        text = re.sub(r" ?\[[^\]]+\]", "", text)
    if spelled.callback is not None and kind == list[str] and not spelled.is_repeated:
        kind = str
    hints = [spelled.form, "may be given several times" if kind == list[str] else ""]
    head, dot, rest = text.removesuffix(".").partition(". ")
    text = "; ".join([head, *filter(None, hints)]) + dot + rest + "."
    settings: dict[str, Any] = {
        "help": text[:1].upper() + text[1:] if re.match(r"[a-z]+([ ,:;]|\.( |$))", keyword.text) else text,
        "metavar": spelled.metavar,
        "callback": spelled.callback,
    }
    is_required = default is REQUIRED
    if not is_required:
        default = Path(default) if kind is Path and default else spelled.shown(default)
    if spelled.is_argument or (is_required and not spelled.names):
        info = typer.Argument(**settings)
    else:
        flags = (f"--{name.replace('_', '-')}",) if kind is bool and default is False else ()
        info = typer.Option(*(spelled.names or flags), **settings)
    annotation: Any = Annotated[kind if default is not None else kind | None, info]
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=REQUIRED if is_required else default
    )


def _help(doc: str, names: Mapping[str, str]) -> str:
    """Return a docstring up to its sections as help: command lines become a paragraph each."""
    paragraphs = []
    for block in re.split(r"\n\n(?=\w+\n-+\n)", doc)[0].split("\n\n"):
        if block.startswith("    "):
            paragraphs += re.split(r"\n(?=    \S)", block)
        elif block == "On the command line::":
            paragraphs.append("Examples:")
        else:
            paragraphs.append(_plain(block, names))
    return "\n\n".join(paragraphs).replace("[", "\\[")


def _plain(text: str, names: Mapping[str, str]) -> str:
    """Return a text of a docstring without its markup, and with options for parameters."""
    text = re.sub(r":\w+:`~?(?:[\w.]*\.)?(\w+)`", r"\1", text)
    text = re.sub(
        r"``([^`]+)``", lambda code: names.get(code[1], code[1] if code[1][0] == "-" else f"`{code[1]}`"), text
    )
    return text.replace('"', "")
