"""Public names of a package: listed once, in its stub ``__init__.pyi``, and imported when they are first used."""

import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


@cache
def public_names(package: str) -> dict[str, str]:
    """Return the module of each public name of a package, in the order of the stub."""
    import ast

    stub = Path(str(sys.modules[package].__file__)).with_suffix(".pyi")
    imports = [line for line in ast.parse(stub.read_text("utf-8")).body if isinstance(line, ast.ImportFrom)]
    return {alias.name: str(line.module) for line in imports for alias in line.names}


def lazily(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__``, which imports a public name, and ``__dir__`` of a package."""
    namespace = vars(sys.modules[package])

    def get(name: str) -> Any:
        if name == "__all__":
            return list(public_names(package))
        if name.startswith("__") or name not in public_names(package):
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        namespace[name] = value = getattr(import_module(public_names(package)[name]), name)
        return value

    return get, lambda: sorted({*namespace, *public_names(package)})
