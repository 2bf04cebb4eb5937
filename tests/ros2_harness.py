"""Compile an exported ROS 2 package against stub headers, and drive its controller with lines of commands."""

from __future__ import annotations

import functools
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

STUBS = Path(__file__).with_name("ros2_stubs")
HEADERS = (
    "controller_interface/chainable_controller_interface.hpp",
    "diagnostic_msgs/msg/diagnostic_array.hpp",
    "diagnostic_msgs/msg/diagnostic_status.hpp",
    "diagnostic_msgs/msg/key_value.hpp",
    "geometry_msgs/msg/wrench_stamped.hpp",
    "hardware_interface/types/hardware_interface_type_values.hpp",
    "pluginlib/class_list_macros.hpp",
    "rclcpp/rclcpp.hpp",
    "realtime_tools/realtime_publisher.hpp",
    "realtime_tools/realtime_thread_safe_box.hpp",
    "sensor_msgs/msg/range.hpp",
    "std_msgs/msg/float64.hpp",
    "trajectory_msgs/msg/joint_trajectory_point.hpp",
)
"""The headers of ROS 2 Jazzy that the controller may include; the stubs declare their content."""

WARNINGS = ("-Wall", "-Wextra", "-Wshadow", "-Wnon-virtual-dtor", "-Woverloaded-virtual", "-pedantic", "-Werror")
PARAMETERS = "src/pretouch_controller_parameters.yaml"

_TYPES = {"string": "std::string", "double": "double", "bool": "bool", "double_array": "std::vector<double>"}
_READERS = {
    "string": "into = text",
    "double": "char *end; into = std::strtod(text.c_str(), &end); if (end == text.c_str() || *end) return refused",
    "bool": 'into = text == "true"; if (!into && text != "false") return refused',
    "double_array": "into.clear(); for (std::size_t i = 0, end; i <= text.size(); i = end + 1) "
    "{ end = std::min(text.find(',', i), text.size()); into.push_back(std::strtod(&text[i], nullptr)); }",
}


def build(package: Path, folder: Path, compiler: str = "g++", optimization: str = "-O0") -> Path:
    """Compile the controller of an exported package and the harness; skip the test if that is impossible here."""
    if shutil.which(compiler) is None or shutil.which("gcc") is None:
        pytest.skip(f"{compiler} or gcc is not installed")
    if not sys.platform.startswith("linux"):
        pytest.skip("the harness counts allocations by the C library of Linux")
    include = folder / "include"
    for name in HEADERS:
        path = include / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text('#include "ros2_stubs.hpp"\n')
    path = include / "pretouch_controller/pretouch_controller_parameters.hpp"
    path.parent.mkdir(parents=True)
    path.write_text(parameter_header((package / PARAMETERS).read_text()))
    law = folder / "law.o"
    subprocess.run(
        ["gcc", "-O2", "-std=c99", "-ffp-contract=off", "-c", str(package / "law/pretouch_law.c"), "-o", str(law)],
        check=True,
    )
    sources = [*sorted((package / "src").glob("*.cpp")), STUBS / "harness.cpp"]
    folders = [include, STUBS, package / "src", package / "law"]
    program = folder / "harness"
    command = [compiler, optimization, "-std=c++17", "-pthread", *WARNINGS, *(f"-I{path}" for path in folders)]
    subprocess.run([*command, *map(str, sources), str(law), "-ldl", "-o", str(program)], check=True)
    return program


def drive(program: Path, *lines: str) -> list[str]:
    """Send lines to the harness and return its answers."""
    run = subprocess.run([str(program)], input="\n".join(lines) + "\n", capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout.splitlines()


def leaves(tree: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name and the description of each parameter of a YAML file of generate_parameter_library."""
    for key, value in tree.items():
        if isinstance(value.get("type"), str):
            yield prefix + key, value
        else:
            yield from leaves(value, f"{prefix}{key}.")


def parameter_header(text: str) -> str:
    """Return a stand-in for the header that generate_parameter_library makes of a YAML file."""
    ((namespace, tree),) = yaml.safe_load(text).items()
    setters = [
        f'    if (name == "{name}") {{ auto &into = stub_params().{name}; {_READERS[leaf["type"]]}; '
        f'{" ".join(_rules(leaf.get("validation", {})))} return ""; }}'
        for name, leaf in leaves(tree)
    ]
    return "\n".join(
        [
            '#pragma once\n#include <algorithm>\n#include <cstdlib>\n#include "ros2_stubs.hpp"',
            f"namespace {namespace} {{",
            "struct Params {",
            *_structure(tree, "    "),
            "};",
            "inline Params &stub_params() { static Params one; return one; }",
            "inline std::string set_stub_parameter(const std::string &name, const std::string &text) {",
            '    const std::string refused = "refused " + name + "\\n";',
            *setters,
            '    return "";\n}',
            "class ParamListener {\npublic:",
            "    explicit ParamListener(const std::shared_ptr<rclcpp_lifecycle::LifecycleNode> &) {}",
            "    Params get_params() { return stub_params(); }\n};\n}",
        ]
    )


def _rules(rules: dict[str, Any]) -> Iterator[str]:
    """Yield the checks of generate_parameter_library: NaN is within `bounds<>`, but neither above nor below a limit."""
    for rule, limits in rules.items():
        match rule:
            case "bounds<>":
                yield f"if (into < {limits[0]!r} || into > {limits[1]!r}) return refused;"
            case "gt<>":
                yield f"if (!(into > {limits[0]!r})) return refused;"
            case "gt_eq<>":
                yield f"if (!(into >= {limits[0]!r})) return refused;"
            case "lt_eq<>":
                yield f"if (!(into <= {limits[0]!r})) return refused;"
            case "one_of<>":
                yield f"if ({' && '.join(f'into != {_literal(text)}' for text in limits[0])}) return refused;"


def _structure(tree: dict[str, Any], indent: str) -> Iterator[str]:
    for key, value in tree.items():
        if isinstance(value.get("type"), str):
            yield f"{indent}{_TYPES[value['type']]} {key} = {_literal(value['default_value'])};"
        else:
            yield f"{indent}struct {{"
            yield from _structure(value, indent + "    ")
            yield f"{indent}}} {key};"


@functools.singledispatch
def _literal(value: Any) -> str:
    return repr(value)


@_literal.register
def _(value: str) -> str:
    return f'"{value}"'


@_literal.register
def _(value: bool) -> str:
    return "true" if value else "false"


@_literal.register
def _(value: list) -> str:  # type: ignore[type-arg]
    return "{" + ", ".join(map(_literal, value)) + "}"
