"""Hatchling's hook: builds the compiled core into the wheel, or beside the sources of an editable install."""

from __future__ import annotations

import importlib.util
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_SPEC = importlib.util.spec_from_file_location("pretouch_native", Path(__file__).parent / "native/build.py")
assert _SPEC is not None
assert _SPEC.loader is not None
native = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(native)


class NativeHook(BuildHookInterface[Any]):
    """The build of the compiled core."""

    def dependencies(self) -> list[str]:
        """Ask pip for a compiler if the machine has none, or one that is too old."""
        return [] if native.working_compilers() else [native.ZIG]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        """Build the library and say for which machines it is; no Python.h is used, so it serves every Python."""
        library = native.build(native.library_path(Path(self.root)))
        for path in (library, native.record_path(library)):
            build_data["artifacts"].append(str(path.relative_to(self.root)))
        page = native.page_core_path(Path(self.root))
        if native.has_zig():
            native.build_page_core(page)
        if page.exists():  # the extra `studio` needs it; without zig, an earlier build serves
            build_data["artifacts"].append(str(page.relative_to(self.root)))
        build_data["pure_python"] = False
        if native.working_compilers():
            tag = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        else:
            tag = native.TARGETS[native.this_target()].tag
        build_data["tag"] = f"py3-none-{tag}"
