"""Write the pages of the documentation that come from tables of the program: python docs/make_pages.py.

tests/contract/test_made_pages.py checks that the pages in the repository are the ones that this program writes.
"""

from __future__ import annotations

import inspect
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from pretouch._core.warning_codes import explanation, warning_codes
from pretouch.cli.app import app
from pretouch.config.quantities import Quantity, UnfitValueError
from pretouch.config.schema import ARRAYS, SECTIONS, variants
from pretouch.config.section import REQUIRED, TAG, Key

DOCS = Path(__file__).parent
MADE = "<!-- written by docs/make_pages.py -->"
GROUPS = {
    "PT1": "Calibration",
    "PT2": "Calibration and encounter",
    "PT3": "Design",
    "PT4": "Sampled loop",
    "PT5": "Robot models",
    "PT6": "Recordings",
    "PT9": "The letter",
}


def pages() -> Iterator[tuple[str, str]]:
    """Yield path and text of each page."""
    yield "warnings/README.md", warning_index()
    yield "reference/commands.md", commands_page()
    yield "reference/scenario-keys.md", keys_page()
    yield "reference/scenario.schema.json", json.dumps(scenario_schema(), indent=1) + "\n"


def warning_index() -> str:
    """Return the page that lists all warnings."""
    lines = [
        MADE,
        "# What a warning means",
        "",
        "Every warning of pretouch has a code, such as PT406. The terminal, the report and the field `warnings` of",
        "`--json` show the code. This page lists all codes. Each code has a page that says what it means, why it",
        "matters and what to do.",
        "",
    ]
    for start, title in GROUPS.items():
        lines += [f"## {title}", "", "| code | warning |", "| --- | --- |"]
        codes = [code for code in warning_codes() if code.startswith(start)]
        lines += [f"| [{code}]({code}.md) | {explanation(code).title} |" for code in codes]
        lines.append("")
    return "\n".join([*lines, "```{toctree}", ":hidden:", "", *warning_codes(), "```", ""])


def commands_page() -> str:
    """Return the page of all commands with their arguments and options, from the program that reads them."""
    group = typer.main.get_command(app)
    context = typer.Context(group, info_name="pretouch")
    lines = [
        MADE,
        "# Commands and options",
        "",
        "This page lists all commands with their arguments and options. [The command line](cli.md) explains the output",
        "and the exit status.",
        "",
    ]
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        lines += [f"## pretouch {name}", "", *_paragraphs(command.help or ""), ""]
        lines += ["| argument or option | meaning |", "| --- | --- |"]
        lines += [_option_row(parameter) for parameter in command.params if parameter.name != "help"]
        examples = re.findall(r"^  (pretouch .*)$", command.epilog or "", re.MULTILINE)
        lines += ["", "```text", *examples, "```", ""]
    return "\n".join(lines)


def _paragraphs(help_text: str) -> list[str]:
    """Return a help text as Markdown; a list that keeps its lines becomes a block."""
    blocks = []
    for part in inspect.cleandoc(help_text).split("\n\n"):
        if part.startswith("\b"):
            blocks += ["```text", part.removeprefix("\b").strip("\n"), "```", ""]
        else:
            blocks += [part.replace("[", "\\[").replace("|", "\\|"), ""]
    return blocks[:-1]


def _option_row(parameter: Any) -> str:
    """Return the table row of one argument or option."""
    names = ", ".join(f"`{name}`" for name in (*parameter.opts, *parameter.secondary_opts))
    metavar = parameter.metavar or ""
    if parameter.param_type_name == "argument":
        names, metavar = f"`{metavar or parameter.name.upper()}`", ""
    value = f" `{metavar}`" if metavar and not getattr(parameter, "is_flag", False) else ""
    default = parameter.default
    shown = isinstance(default, int | float | str) and default not in {False, True, ""}
    ending = f" (default: {default})" if shown else ""
    help_text = (getattr(parameter, "help", None) or "").replace("|", "\\|").replace("[", "\\[")
    return f"| {names}{value.replace('|', chr(92) + '|')} | {help_text}{ending} |"


def _keys() -> Iterator[tuple[str, str, Key]]:
    """Yield section, name and description of every key of a scenario file, for the built-in kinds."""
    for section in SECTIONS:
        seen: dict[str, Key] = {}
        for variant in variants(section).values():
            for name, key in variant.keys.items():
                seen.setdefault(name, key)
        for name, key in seen.items():
            yield section, name, key


def _allowed(key: Key) -> str:
    """Return what a key accepts, in the words of the message that refuses another value."""
    if isinstance(key.read, Quantity):
        return key.read.expected
    if key.read is TAG.read:
        return "the kind of the section"
    try:
        (key.after[1](None) if key.after else key.read)(object())
    except UnfitValueError as error:
        return error.mistakes[0][1].removeprefix("expected ").partition("; did you mean")[0]
    return "any value"


def _default(key: Key) -> str:
    if key.default is REQUIRED:
        return "required"
    return "none" if key.default is None else json.dumps(key.default) if not _infinite(key.default) else '"inf"'


def _infinite(value: object) -> bool:
    return isinstance(value, float) and math.isinf(value)


def keys_page() -> str:
    """Return the page of all sections and keys, from the schema that reads scenario files."""
    lines = [
        MADE,
        "# All sections and keys",
        "",
        "This page lists every key of a scenario file, with the values that it accepts and its default. A section can",
        "have several kinds: a key is required, or allowed, only in the kinds that have it. [The scenario",
        "file](scenario-file.md) explains the sections, their kinds and the keys.",
    ]
    section = ""
    for name, key, description in _keys():
        if name != section:
            section = name
            title = f"\\[\\[{name}]]" if name in ARRAYS else f"\\[{name}\\]"
            lines += ["", f"## {title}", "", "| key | accepts | default |", "| --- | --- | --- |"]
        accepts = _allowed(description).replace("|", "\\|").replace("[", "\\[").replace("<", "&lt;")
        lines.append(f"| `{key}` | {accepts} | {_default(description)} |")
    return "\n".join([*lines, ""])


def scenario_schema() -> dict[str, Any]:
    """Return a JSON schema (draft 2020-12) of scenario files, which editors use for completion."""
    sections: dict[str, Any] = {}
    for name, key, description in _keys():
        section = sections.setdefault(name, {"type": "object", "properties": {}})
        section["properties"][key] = _schema_of(description)
    for name in ARRAYS:
        sections[name] = {"type": "array", "items": sections[name]}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "pretouch scenario",
        "type": "object",
        "properties": sections,
        "required": ["sensor", "admittance", "obstacle"],
        "additionalProperties": False,
    }


def _schema_of(key: Key) -> dict[str, Any]:
    """Return the JSON schema of one key."""
    described: dict[str, Any] = {"description": _allowed(key)}
    if key.default is not REQUIRED and key.default is not None and not _infinite(key.default):
        described["default"] = key.default
    if isinstance(key.read, Quantity):
        return {**described, "type": ["number", "string"]}
    names = re.findall(r'"([^"]+)"', described["description"])
    if described["description"].startswith("one of ") and key.read is not TAG.read:
        return {**described, "enum": names}
    return described


def main() -> None:
    """Write all pages."""
    for path, text in pages():
        target = DOCS / path
        target.parent.mkdir(exist_ok=True)
        target.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
