"""From a document to its sections: every mistake found, placed and said in a sentence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final, get_args

from pydantic import ValidationError

from .document import Document, Mistake
from .positions import KeyPath
from .quantities import shown
from .robust_sections import uncertainty_section
from .schema import REQUIRED, SECTIONS, keys_of, quantity_of_key
from .section import Section, nearest, one_of
from .sensor_sections import CALIBRATION

__all__ = ["read_sections"]

_BY_KEYS: Final = {
    "admittance": ({"natural_frequency", "damping_ratio"}, "natural_frequency", "damping"),
    "impact": ({"radius", "effective_modulus"}, "radius", "stiffness"),
}
_BY_KIND: Final = ("objective", "robot", "contact")
_TABLES: Final = {
    "objective": '{ quantity = "time", scale = "1 s" }',
    "uncertainty": "{ uniform = [smallest, largest] } or { normal = [mean, standard deviation] }",
}


def read_sections(document: Document) -> tuple[dict[str, Section], list[Mistake]]:
    """Read every section of a document.

    Args:
        document: the file.

    Returns:
        The sections that could be read, by name, and the mistakes of all others.
    """
    sections: dict[str, Section] = {}
    mistakes = list(_unknown_sections(document))
    for name in SECTIONS:
        if name not in document.data:
            if name in REQUIRED and not any(nearest(found, tuple(SECTIONS)) == name for found in _strangers(document)):
                mistakes.append(
                    document.mistake((name,), f"found no such section, expected [{name}] with {REQUIRED[name]}")
                )
            continue
        found = document.data[name]
        if not isinstance(found, dict):
            what = f"[[{name}]]" if isinstance(found, list) else shown(found)
            mistakes.append(document.mistake((name,), f"found {what}, expected a section [{name}] with keys"))
            continue
        variant = _variant(name, found)
        if isinstance(variant, tuple):
            mistakes.append(document.mistake(*variant))
            continue
        try:
            sections[name] = variant.model_validate(found)
        except ValidationError as error:
            mistakes.extend(_mistakes_of_section(document, name, variant, error))
    return sections, mistakes


def _strangers(document: Document) -> list[str]:
    return [name for name in document.data if name not in SECTIONS]


def _unknown_sections(document: Document) -> Iterator[Mistake]:
    """Refuse what is no section, and say which one is meant."""
    for name in _strangers(document):
        homes = [f"[{section}]" for section in SECTIONS if name in keys_of(section)]
        near = nearest(name, tuple(SECTIONS))
        if not isinstance(document.data[name], (dict, list)) and homes:
            sentence = f"found a key outside of a section, expected it in {' or '.join(homes)}"
        else:
            expected = f"[{near}]" if near else f"one of {', '.join(f'[{s}]' for s in SECTIONS)}"
            sentence = f"found an unknown section, expected {expected}"
        yield document.mistake((name,), sentence)


def _variant(name: str, found: Mapping[str, Any]) -> type[Section] | tuple[KeyPath, str]:
    """Choose the variant of a section by what it holds; a place and a sentence where it holds nothing of the kind."""
    variants = SECTIONS[name]
    if name == "sensor":
        if "calibration" in found:
            return variants["calibration"]
        return _named(name, "model", found, variants, ', or calibration = "sensor.csv"')
    if name in _BY_KIND:
        return _named(name, "kind", found, variants, "")
    if name == "uncertainty":
        return uncertainty_section()
    if name in _BY_KEYS:
        keys, with_them, without = _BY_KEYS[name]
        return variants[with_them if keys & set(found) else without]
    return variants[""]


def _named(
    section: str, key: str, found: Mapping[str, Any], variants: Mapping[str, type[Section]], alternative: str
) -> type[Section] | tuple[KeyPath, str]:
    """Choose a variant by the name that `key` gives."""
    names = tuple(name for name in variants if name != CALIBRATION)
    if key in found:
        value = found[key]
        if isinstance(value, str) and value != CALIBRATION and value in variants:
            return variants[value]
        return (section, key), f"found {shown(value)}, {one_of(value, names)}"
    keys = (key, "calibration") if alternative else (key,)
    for stranger in found:
        near = nearest(stranger, keys) if stranger not in keys_of(section) else None
        if near:
            return (section, stranger), f'found an unknown key, expected "{near}"'
    return (section, key), f'missing, {one_of(None, names)}{alternative}; add, for example: {key} = "{names[0]}"'


def _mistakes_of_section(
    document: Document, name: str, variant: type[Section], error: ValidationError
) -> Iterator[Mistake]:
    """Turn what pydantic says about a section into mistakes with a place."""
    found = document.data[name]
    strangers = tuple(key for key in found if key not in variant.model_fields)
    meant = {nearest(key, tuple(k for k in variant.model_fields if k not in found)) for key in strangers}
    for detail in error.errors(include_url=False):
        path: KeyPath = (name, *detail["loc"])
        kind = detail["type"]
        if kind == "value_error":
            unfit = detail["ctx"]["error"]
            path = (*path, unfit.key) if unfit.key else path
            sentence = str(unfit)
            if sentence.startswith("expected"):
                sentence = f"found {shown(detail['input'])}, {sentence}"
        elif kind == "missing":
            if len(path) == 2 and path[1] in meant:
                continue
            sentence = _missing(_model_at(variant, path[1:-1]), str(path[-1]))
        elif kind == "extra_forbidden" and len(path) == 2:
            sentence = _stranger(document, name, variant, str(path[1]))
        elif kind == "extra_forbidden":
            keys = tuple(_model_at(variant, path[1:-1]).model_fields)
            near = nearest(str(path[-1]), keys)
            meaning = f'; did you mean "{near}"?' if near else ""
            sentence = f"found an unknown key, expected one of {', '.join(keys)}{meaning}"
        else:
            sentence = f"found {shown(detail['input'])}, expected {_expected_of(kind, name)}"
        yield document.mistake(path, sentence)


def _expected_of(kind: str, section: str) -> str:
    return f"a table such as {_TABLES.get(section, '{ ... }')}" if kind == "model_type" else "another value"


def _model_at(variant: type[Section], path: KeyPath) -> type[Section]:
    """Return the model of a table inside a section, by the keys that lead to it."""
    model = variant
    for key in path:
        if isinstance(key, str):
            kinds = _sections_in(model.model_fields[key].annotation)
            model = kinds[0] if kinds else model
    return model


def _sections_in(annotation: Any) -> list[type[Section]]:
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return [annotation]
    return [found for part in get_args(annotation) for found in _sections_in(part)]


def _missing(variant: type[Section], key: str) -> str:
    """Say that a key is missing, what it takes, and show a line with it."""
    quantity = quantity_of_key(variant, key)
    if quantity is not None:
        return f"missing, expected {quantity.expected}; add, for example: {key} = {quantity.example}"
    examples = {
        "bounds": '["-10 N*s", "-0.01 N*s"]',
        "distances": '["0 mm", "10 mm", "20 mm"]',
        "outputs": '["4 V", "2 V", "1 V"]',
        "terms": '[{ quantity = "time", scale = "1 s" }]',
        "quantity": '"time"',
        "scale": '"1 s"',
    }
    return f"missing; add, for example: {key} = {examples.get(key, '...')}"


def _stranger(document: Document, name: str, variant: type[Section], key: str) -> str:
    """Say what an unknown key may have been meant to be, or where it belongs."""
    takes = ", ".join(variant.model_fields)
    if key in keys_of(name):
        return _of_another_variant(document, name, takes, key)
    near = nearest(key, tuple(variant.model_fields)) or nearest(key, keys_of(name))
    if near:
        return f'found an unknown key, expected "{near}"'
    homes = [f"[{section}]" for section in SECTIONS if key in keys_of(section)]
    if homes:
        return f"found a key of {' or '.join(homes)}, expected only {takes} in [{name}]"
    return f"found an unknown key, expected one of {takes}"


def _of_another_variant(document: Document, name: str, takes: str, key: str) -> str:
    """Say that a key belongs to another variant of its section than the one that was chosen."""
    found = document.data[name]
    owners = [tag for tag, other in SECTIONS[name].items() if key in other.model_fields]
    if name == "sensor" and "calibration" in found:
        line = document.lines["sensor", "calibration"]
        return (
            f"found a parameter beside calibration (line {line}), expected either a model by its parameters, "
            "or a calibration to be fitted"
        )
    if name == "sensor" and owners == ["calibration"]:
        return "found a key that belongs to a calibration, expected it only beside calibration = ..."
    if name == "sensor" or name in _BY_KIND:
        chosen = found["model" if name == "sensor" else "kind"]
        return f'found a key of {_quoted(owners)}, which "{chosen}" does not take; expected only {takes}'
    return f"found beside {', '.join(k for k in found if k != key)}, expected only {takes}"


def _quoted(names: list[str]) -> str:
    return " and ".join(f'"{name}"' for name in names)
