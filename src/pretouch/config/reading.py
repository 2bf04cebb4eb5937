"""From the data of a file to its sections: every mistake found, placed in its line and said in a sentence."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Final, TypeAlias, TypeVar

from pretouch._core.errors import InvalidInputError, OutOfRangeError, ScenarioFileError
from pretouch.motion.laws import DAMPER, LAWS

from .document import key_lines
from .quantities import KeyPath, UnfitValueError, shown
from .schema import OF_A_LAW, SECTIONS, keys_of, needed, variants
from .section import Section, nearest, one_of
from .sensor import CALIBRATION, sensor_variants

Mistake: TypeAlias = tuple[KeyPath, str]
"""The key that a mistake is about, and a sentence with what was found and what is expected."""

_HOME: Final[dict[str, KeyPath]] = {
    "bounds": ("gain", "bounds"),
    "method": ("motion", "method"),
    "horizon": ("motion", "horizon"),
    "scale": ("objective",),
    "terms": ("objective", "terms"),
    "quantity": ("objective",),
    "distance": ("sensor",),
    "scenario": ("obstacle",),
    "sensor": ("sensor",),
    "natural_frequency": ("admittance", "natural_frequency_bounds"),
    "damping_ratio": ("admittance", "damping_ratio_bounds"),
    "quantities": ("pareto", "quantities"),
    "choice": ("pareto", "choice"),
    "impact_force": ("impact",),
    "drive_force": ("impact",),
    "uncertainty": ("uncertainty",),
    "samples": ("robust", "samples"),
    "seed": ("robust", "seed"),
    "confidence": ("robust", "confidence"),
    "stability_margin": ("loop", "stability_margin"),
    "effect": ("law",),
    **{name: ("law", name) for name in ("ratio", "excursion", "acceleration", "contact_speed", "largest_speed")},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioSource:
    """The file that a task was read from.

    Args:
        path: where it stood.
        text: its text, so that a report can show it.
        sha256: the hash of its bytes, in hexadecimal.
        supported: where the calibration of its sensor supports the curve, as a sentence; empty without one.
        calibration_files: what was read for the calibration of its sensor.
    """

    path: Path
    text: str = field(repr=False)
    sha256: str
    supported: str = field(default="", repr=False)
    calibration_files: tuple[Path, ...] = field(default=(), repr=False)

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Every file that was read, none of which may be written over."""
        return (self.path, *self.calibration_files)

    @property
    def lines(self) -> Mapping[KeyPath, int]:
        """The line of every key."""
        return _lines_of(self.text)

    def placed(self, error: InvalidInputError) -> InvalidInputError:
        """Return what a verb refuses as a mistake of the file, with line and key as near as they are known."""
        if isinstance(error, ScenarioFileError):  # placed by a verb that this one has called
            return error
        told = self.explained(error)
        path, sentence = place(told, "")
        known = path[:1] in self.lines
        return ScenarioFileError(self.listed([(path, sentence)]) if known else f"{self.path}: {told}")

    def explained(self, error: InvalidInputError) -> str:
        """Return the message of an error, with the calibration as the reason where a sensor says nothing."""
        return f"{error}; {self.supported}" if self.supported and isinstance(error, OutOfRangeError) else str(error)

    def listed(self, mistakes: Iterable[Mistake]) -> str:
        """List mistakes, one sentence each, by line: that of the key, of what would hold it, or the last."""
        last = self.text.rstrip().count("\n") + 1
        told = []
        for path, sentence in dict.fromkeys(mistakes):
            line = next((self.lines[path[:n]] for n in range(len(path), 0, -1) if path[:n] in self.lines), last)
            told.append((line, f"{_dotted(path)}: {sentence}" if path else sentence))
        ordered = sorted(told, key=lambda each: each[0])
        return "\n".join(f"{self.path}, line {line}: {text}" for line, text in ordered)


_lines_of = lru_cache(maxsize=4)(key_lines)


def _dotted(path: KeyPath) -> str:
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            shown = part if re.fullmatch(r"[\w-]{1,60}", part) else repr(part[:60])
            text += f".{shown}" if text else shown
    return text


def place(message: str, section: str) -> Mistake:
    """Split a message `name: found ..., which ...` into the key that it speaks of, and the sentence.

    The name may be a key of the section that was being built, where one is given, or the words of a key.

    Returns:
        The path of the key, as near as it is known, and the sentence.

    Examples:
        >>> place("obstacle position: found a distance of 0 m", "")
        (('obstacle', 'position'), 'found a distance of 0 m')
        >>> place("mass: found -1 kg, which must be positive", "admittance")
        (('admittance', 'mass'), 'found -1 kg, which must be positive')
    """
    name, colon, sentence = message.partition(": ")
    if not colon:
        return ((section,) if section else ()), message
    words, key = name.split(" ", 1), name.replace(" ", "_")
    if section and key in keys_of(section):
        return (section, key), sentence
    if len(words) == 2 and words[0] in SECTIONS and words[1].replace(" ", "_") in keys_of(words[0]):
        return (words[0], words[1].replace(" ", "_")), sentence
    if len(words) == 2 and words[0] == "constraint" and words[1] in keys_of("constraints"):
        return ("constraints", words[1]), sentence
    if section:
        return (section,), message
    return (_HOME[name], sentence) if name in _HOME else ((), message)


T = TypeVar("T")

_BY_KEYS: Final = {
    "admittance": ({"natural_frequency", "damping_ratio"}, "natural_frequency", "damping"),
    "impact": ({"radius", "effective_modulus"}, "radius", "stiffness"),
}
_TAGS: Final = {"sensor": "model", "objective": "kind", "robot": "kind", "contact": "kind", "law": "kind"}
"""The key that names the variant."""


class Reading:
    """The sections of a file: their values, what is made of them, and every mistake on the way.

    Args:
        source: the file.
        data: what `tomllib` read in it.

    Attributes:
        kind: of the law; None where [law] does not tell it, and what follows the law is then not read.
    """

    def __init__(self, source: ScenarioSource, data: Mapping[str, Any]) -> None:
        self.source, self.data = source, data
        self.unread: list[Mistake] = list(_unknown_sections(data))
        self.mistakes: list[Mistake] = []
        self.sections: dict[str, tuple[Section, dict[str, Any]]] = {}
        self.meant = {nearest(name, SECTIONS) for name in data if name not in SECTIONS}  # by names that are none
        law = data.get("law", {} if "law" in self.meant else {"kind": DAMPER.kind})
        kind = law.get("kind") if isinstance(law, dict) else None
        self.kind = kind if isinstance(kind, str) and kind in LAWS else None
        examples = needed(self.kind or DAMPER.kind, law if isinstance(law, dict) else ())
        for name in SECTIONS:
            if name in data:
                self._read(name, data[name])
            elif name in examples and name not in self.meant:
                self.unread.append(((name,), f"found no such section, expected [{name}] with {examples[name]}"))

    def _read(self, name: str, found: Any) -> None:
        """Read a section; note its mistakes where it has some."""
        if not isinstance(found, dict):
            what = f"[[{name}]]" if isinstance(found, list) else shown(found)
            self.unread.append(((name,), f"found {what}, expected a section [{name}] with keys"))
            return
        if name in OF_A_LAW and self.kind is None:
            return
        variant = _variant(name, found, self.kind or "")
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


def _variant(name: str, found: Mapping[str, Any], law: str) -> Section | Mistake:
    """Choose the variant of a section by what it holds, or by the law; a mistake where it holds nothing of the kind."""
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
    return known[law if name in OF_A_LAW else ""]


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


_INSTEAD: Final = {
    ("controller", "gain"): 'drag = "0.0144 N*s^2" in [law]',
    ("constraints", "gain"): "bounds in [gain]",
}


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
    if name in OF_A_LAW:
        instead = _INSTEAD.get((name, key), f"only {takes}")
        return f'found a key of law kind "{owners[0]}", which the law of this file does not take; expected {instead}'
    if name in _TAGS:
        quoted = " and ".join(f'"{owner}"' for owner in owners)
        return f'found a key of {quoted}, which "{found[_TAGS[name]]}" does not take; expected only {takes}'
    return f"found beside {', '.join(k for k in found if k != key)}, expected only {takes}"
