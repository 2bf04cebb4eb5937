"""From the data of a file to its sections: every mistake found, placed and said in a sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, Final, TypeVar

from pretouch._core.errors import InvalidInputError

from .quantities import KeyPath, UnfitValueError, shown
from .schema import NEEDED, SECTIONS, keys_of, variants
from .section import Section, nearest, one_of
from .sensor_sections import CALIBRATION, sensor_variants
from .source import Mistake, ScenarioSource, place

__all__ = ["Reading"]

T = TypeVar("T")

_BY_KEYS: Final = {
    "admittance": ({"natural_frequency", "damping_ratio"}, "natural_frequency", "damping"),
    "impact": ({"radius", "effective_modulus"}, "radius", "stiffness"),
}
_TAGS: Final = {"sensor": "model", "objective": "kind", "robot": "kind", "contact": "kind"}
"""The key that names the variant."""


class Reading:
    """The sections of a file: their values, what is made of them, and every mistake on the way.

    Args:
        source: the file.
        data: what `tomllib` read in it.
    """

    def __init__(self, source: ScenarioSource, data: Mapping[str, Any]) -> None:
        self.source, self.data = source, data
        self.unread: list[Mistake] = list(_unknown_sections(data))
        self.mistakes: list[Mistake] = []
        self.sections: dict[str, tuple[Section, dict[str, Any]]] = {}
        self.meant = {nearest(name, SECTIONS) for name in data if name not in SECTIONS}  # by names that are none
        for name in SECTIONS:
            if name in data:
                self._read(name, data[name])
            elif name in NEEDED and name not in self.meant:
                self.unread.append(((name,), f"found no such section, expected [{name}] with {NEEDED[name]}"))

    def _read(self, name: str, found: Any) -> None:
        """Read a section; note its mistakes where it has some."""
        if not isinstance(found, dict):
            what = f"[[{name}]]" if isinstance(found, list) else shown(found)
            self.unread.append(((name,), f"found {what}, expected a section [{name}] with keys"))
            return
        variant = _variant(name, found)
        if not isinstance(variant, Section):
            self.unread.append(variant)
            return
        try:
            self.sections[name] = variant, variant(found, partial(_stranger, self.source, name, variant, found))
        except UnfitValueError as unfit:
            self.unread += [((name, *path), sentence) for path, sentence in unfit.mistakes]

    def refuse(self, path: KeyPath, sentence: str) -> None:
        """Note a mistake at a key."""
        self.mistakes.append((path, sentence))

    def attempt(self, section: str, make: Callable[[], T], path: KeyPath = ()) -> T | None:
        """Make an object; note the mistake where that is refused, at a key where that is known."""
        try:
            return make()
        except InvalidInputError as error:
            self.refuse(*((path, str(error)) if path else place(str(error), section)))
            return None

    def values(self, section: str) -> dict[str, Any] | None:
        """Return the values of a section; None where the file has none, or mistakes in it."""
        return self.sections[section][1] if section in self.sections else None

    def settings(self, section: str) -> dict[str, Any]:
        """Return the values of a section that may be left out, by default those of an empty one."""
        return dict(self.sections[section][1]) if section in self.sections else variants(section)[""]({})

    def made(self, section: str, without: tuple[str, ...] = ()) -> Any:
        """Make what a section describes, without what is said of it beside."""
        if section not in self.sections:
            return None
        variant, values = self.sections[section]
        make: Any = variant.make
        return self.attempt(section, lambda: make(**{k: v for k, v in values.items() if k not in without}))


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
