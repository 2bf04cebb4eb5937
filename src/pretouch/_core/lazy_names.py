"""Load public names lazily: a module's stub (.pyi) lists them, and each is imported when it is first used."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any


def lazy_names(module: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Create `__getattr__` and `__dir__` of a module, so that its public names are imported on first use.

    The stub of the module (`.pyi`) lists the names, one import per line, for type checkers and for this function. A
    program imports only the packages that it uses.

    Args:
        module: `__name__` of the module.

    Returns:
        The functions `__getattr__` and `__dir__`.
    """
    if hasattr(sys.modules[module], "__path__"):
        sys.meta_path.append(_AliasFinder(module))  # the last finder gets only names that no folder has

    def load(name: str) -> Any:
        if name == "__all__":
            return names()
        origin = None if name.startswith("__") else listed(module).get(name)
        if origin is None:
            hint = "" if name.startswith("_") else _hint(name, names())
            raise AttributeError(f"module {module!r} has no attribute {name!r}{hint}")
        home = None if origin[0] == module else import_module(origin[0])
        value = getattr(home, origin[1]) if hasattr(home, origin[1]) else import_module(".".join(origin))
        setattr(sys.modules[module], name, value)
        return value

    def names() -> list[str]:
        return sorted(listed(module))

    return load, names


def _hint(name: str, names: list[str]) -> str:
    """Return a suggestion for a misspelled name, such as `verify_gain` for `verify`, or an empty text."""
    from difflib import get_close_matches  # noqa: PLC0415 - only for mistakes

    similar = [known for known in names if len(name) > 2 and name.lower() in known.lower()]
    similar = similar[:3] or get_close_matches(name, names, 1)
    return f"; did you mean {' or '.join(similar)}?" if similar else ""


class _AliasFinder:
    """Import hook for modules that a package lists under another name than their location.

    For example, `import pretouch.robust` gives the module `pretouch.design.robust`.

    Args:
        package: the package that lists the names.
    """

    def __init__(self, package: str) -> None:
        self._package = package

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:  # noqa: ARG002
        """Return the import spec of a module that the package lists, or None for any other name."""
        package, _, name = fullname.rpartition(".")
        if package != self._package or name not in listed(package):
            return None
        listed_value = getattr(sys.modules[package], name)
        loader: Any = self  # no base class of importlib.abc, which is slow to import
        return (
            ModuleSpec(fullname, loader, loader_state=listed_value.__spec__)
            if isinstance(listed_value, ModuleType)
            else None
        )

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module to which an alias refers; it is imported already."""
        return import_module(spec.loader_state.name)

    def exec_module(self, module: ModuleType) -> None:
        """Restore a module's own import spec, which the import system has just replaced."""
        replaced: Any = module.__spec__
        module.__spec__ = replaced.loader_state


@lru_cache
def listed(module: str) -> dict[str, tuple[str, str]]:
    """Read the public names of a module from its stub file (`.pyi`).

    Args:
        module: `__name__` of the module.

    Returns:
        For each name, the module that defines it and its name there.
    """
    stub = str(sys.modules[module].__file__) + "i"
    package = module if hasattr(sys.modules[module], "__path__") else module.rpartition(".")[0]
    with open(stub, encoding="utf-8") as file:
        lines = [line.split() for line in file if line.startswith("from .")]
    return {name: (f"{package}{home}".rstrip("."), name) for _, home, _, name, *_ in lines}
