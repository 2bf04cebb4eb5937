"""Names that are listed once, in a module's stub, and loaded when they are first used."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any


def lazy_names(module: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return what loads the names of a module when they are first asked for: its `__getattr__` and `__dir__`.

    The stub beside the module (`.pyi`) lists them, one import a line, for type checkers and for this; a program pays
    only for the folders that it needs.

    Args:
        module: its `__name__`.

    Returns:
        Both functions.
    """
    if hasattr(sys.modules[module], "__path__"):
        sys.meta_path.append(_Rooms(module))  # at the end: asked for what no folder has

    def load(name: str) -> Any:
        if name == "__all__":
            return names()
        found = None if name.startswith("__") else listed(module).get(name)
        if found is None:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        home = None if found[0] == module else import_module(found[0])
        value = getattr(home, found[1]) if hasattr(home, found[1]) else import_module(".".join(found))
        setattr(sys.modules[module], name, value)
        return value

    def names() -> list[str]:
        return sorted(listed(module))

    return load, names


class _Rooms:
    """Lets `import package.name` work for a module that the package lists under another name than its folder's.

    It is the same module: `import pretouch.robust` gives `pretouch.design.robust`.

    Args:
        package: the package that lists names.
    """

    def __init__(self, package: str) -> None:
        self._package = package

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:  # noqa: ARG002
        """Return a spec for a listed module; None for any other name."""
        package, _, name = fullname.rpartition(".")
        if package != self._package or name not in listed(package):
            return None
        room = getattr(sys.modules[package], name)
        loader: Any = self  # without a base from importlib.abc, which loads slowly
        return ModuleSpec(fullname, loader, loader_state=room.__spec__) if isinstance(room, ModuleType) else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module, which is loaded."""
        return import_module(spec.loader_state.name)

    def exec_module(self, module: ModuleType) -> None:
        """Give the module back the spec that the import system has just replaced."""
        replaced: Any = module.__spec__
        module.__spec__ = replaced.loader_state


@lru_cache
def listed(module: str) -> dict[str, tuple[str, str]]:
    """Read the names of a module from its stub.

    Args:
        module: its `__name__`.

    Returns:
        By name the package or module that has it, and its name there.
    """
    stub = str(sys.modules[module].__file__) + "i"
    package = module if hasattr(sys.modules[module], "__path__") else module.rpartition(".")[0]
    with open(stub, encoding="utf-8") as file:
        lines = [line.split() for line in file if line.startswith("from .")]
    return {name: (f"{package}{home}".rstrip("."), name) for _, home, _, name, *_ in lines}
