"""From the data of a file to its sections: every mistake found, placed and said in a sentence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, Final, TypeAlias

from .quantities import UnfitValueError, shown
from .schema import NEEDED, SECTIONS, keys_of, variants
from .section import Section, nearest, one_of
from .sensor_sections import CALIBRATION, sensor_variants
from .source import Mistake, ScenarioSource

__all__ = ["Sections", "read_sections"]

Sections: TypeAlias = Mapping[str, tuple[Section, dict[str, Any]]]
"""The variant of every section of a file, and its values, by name."""

_BY_KEYS: Final = {
    "admittance": ({"natural_frequency", "damping_ratio"}, "natural_frequency", "damping"),
    "impact": ({"radius", "effective_modulus"}, "radius", "stiffness"),
}
_TAGS: Final = {"sensor": "model", "objective": "kind", "robot": "kind", "contact": "kind"}
"""The key that names the variant."""


def read_sections(source: ScenarioSource, data: Mapping[str, Any]) -> tuple[Sections, list[Mistake]]:
    """Return the sections that could be read, and the mistakes of all others."""
    sections: dict[str, tuple[Section, dict[str, Any]]] = {}
    mistakes = list(_unknown_sections(data))
    meant = {nearest(name, SECTIONS) for name in data if name not in SECTIONS}
    for name in SECTIONS:
        found = data.get(name)
        if found is None:
            if name in NEEDED and name not in meant:
                mistakes.append(((name,), f"found no such section, expected [{name}] with {NEEDED[name]}"))
        elif not isinstance(found, dict):
            what = f"[[{name}]]" if isinstance(found, list) else shown(found)
            mistakes.append(((name,), f"found {what}, expected a section [{name}] with keys"))
        else:
            variant = _variant(name, found)
            if not isinstance(variant, Section):
                mistakes.append(variant)
                continue
            try:
                sections[name] = variant, variant(found, partial(_stranger, source, name, variant, found))
            except UnfitValueError as unfit:
                mistakes += [((name, *path), sentence) for path, sentence in unfit.mistakes]
    return sections, mistakes


def _unknown_sections(data: Mapping[str, Any]) -> Iterator[Mistake]:
    """Refuse what is no section, and say which one is meant."""
    for name in data:
        if name in SECTIONS:
            continue
        homes = [f"[{section}]" for section in SECTIONS if name in keys_of(section)]
        near = nearest(name, SECTIONS)
        if not isinstance(data[name], (dict, list)) and homes:
            yield (name,), f"found a key outside of a section, expected it in {' or '.join(homes)}"
        else:
            expected = f"[{near}]" if near else f"one of {', '.join(f'[{s}]' for s in SECTIONS)}"
            yield (name,), f"found an unknown section, expected {expected}"


def _variant(name: str, found: Mapping[str, Any]) -> Section | Mistake:
    """Choose the variant of a section by what it holds; a mistake where it holds nothing of the kind."""
    if name == "sensor":
        taken = sensor_variants(foreign=True)
        calibrated = taken.pop(CALIBRATION)
        return calibrated if CALIBRATION in found else _named(name, found, taken)
    known = variants(name)
    if name in _TAGS:
        return _named(name, found, known)
    if name in _BY_KEYS:
        keys, with_them, without = _BY_KEYS[name]
        return known[with_them if keys & set(found) else without]
    return known[""]


def _named(section: str, found: Mapping[str, Any], taken: Mapping[str, Section]) -> Section | Mistake:
    """Choose a variant by the name that a key gives."""
    names = tuple(name for name in variants(section) if name != CALIBRATION)
    key = _TAGS[section]
    if key in found:
        value = found[key]
        if isinstance(value, str) and value in taken:
            return taken[value]
        return (section, key), f"found {shown(value)}, {one_of(value, names)}"
    keys, alternative = ((key, CALIBRATION), ', or calibration = "sensor.csv"') if section == "sensor" else ((key,), "")
    for stranger in found:
        near = nearest(stranger, keys) if stranger not in keys_of(section) else None
        if near:
            return (section, stranger), f'found an unknown key, expected "{near}"'
    return (section, key), f'missing, {one_of(None, names)}{alternative}; add, for example: {key} = "{names[0]}"'


def _stranger(source: ScenarioSource, name: str, variant: Section, found: Mapping[str, Any], key: str) -> str:
    """Say what an unknown key may have been meant to be, or where it belongs."""
    takes = ", ".join(variant.keys)
    if key in keys_of(name):
        return _of_another_variant(source, name, takes, found, key)
    near = nearest(key, tuple(variant.keys)) or nearest(key, keys_of(name))
    if near:
        return f'found an unknown key, expected "{near}"'
    homes = [f"[{section}]" for section in SECTIONS if key in keys_of(section)]
    if homes:
        return f"found a key of {' or '.join(homes)}, expected only {takes} in [{name}]"
    return f"found an unknown key, expected one of {takes}"


def _of_another_variant(source: ScenarioSource, name: str, takes: str, found: Mapping[str, Any], key: str) -> str:
    """Say that a key belongs to another variant of its section than the one that was chosen."""
    owners = [tag for tag, other in variants(name).items() if key in other.keys]
    if name == "sensor" and CALIBRATION in found:
        return (
            f"found a parameter beside calibration (line {source.lines['sensor', CALIBRATION]}), expected either a "
            "model by its parameters, or a calibration to be fitted"
        )
    if name == "sensor" and owners == [CALIBRATION]:
        return "found a key that belongs to a calibration, expected it only beside calibration = ..."
    if name in _TAGS:
        quoted = " and ".join(f'"{owner}"' for owner in owners)
        return f'found a key of {quoted}, which "{found[_TAGS[name]]}" does not take; expected only {takes}'
    return f"found beside {', '.join(k for k in found if k != key)}, expected only {takes}"
