"""Run the core of the page, which is WebAssembly, in node; build it if ziglang is installed."""

from __future__ import annotations

import importlib.util
import json
import math
import os
import shutil
import subprocess
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "src/pretouch/studio/page"


@lru_cache(maxsize=1)
def built_core() -> Path:
    """Return the path of the core, which is built if it is missing; skip the test if it cannot be built."""
    spec = importlib.util.spec_from_file_location("native_build", ROOT / "native/build.py")
    assert spec is not None
    assert spec.loader is not None
    native = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(native)
    path = native.page_core_path(ROOT)
    if native.has_zig():
        native.build_page_core(path.with_suffix(f".{os.getpid()}"))
        path.with_suffix(f".{os.getpid()}").replace(path)
    elif not path.exists():
        pytest.skip("the core of the page is not built, and ziglang is not installed")
    return path


def solve_in_node(requests: list[dict[str, Any]]) -> list[Any]:
    """Solve requests by tests/page/solve.mjs; skip the test without node."""
    if shutil.which("node") is None:
        pytest.skip("node is not installed")
    command = ["node", ROOT / "tests/page/solve.mjs", built_core(), PAGE / "core.js"]
    text = json.dumps(_without_infinities(requests))
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout, object_hook=_with_infinities)


def _without_infinities(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _without_infinities(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_without_infinities(part) for part in value]
    return ("inf" if value > 0 else "-inf") if isinstance(value, float) and math.isinf(value) else value


def _with_infinities(content: dict[str, Any]) -> dict[str, Any]:
    words = {"Infinity": math.inf, "-Infinity": -math.inf, "NaN": math.nan}
    return {name: words.get(value, value) if isinstance(value, str) else value for name, value in content.items()}
