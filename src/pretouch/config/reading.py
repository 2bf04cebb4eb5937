"""Parse a scenario file and report all its mistakes.

The mistakes are reported together, with their line numbers.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Final, TypeAlias, TypeVar

from pretouch._core.errors import FileMistake, InvalidInputError, OutOfRangeError, ScenarioFileError
from pretouch.motion.laws import DAMPER, LAW_KINDS

from .key_lines import key_lines
from .quantities import KeyPath, UnfitValueError, value_text
from .robot_section import MODEL
from .schema import ARRAYS, OF_A_LAW, SECTIONS, extensions_of, keys_of, required_sections, variants
from .section import Section, list_of, nearest, one_of
from .sensor import CALIBRATION, sensor_variants

Mistake: TypeAlias = tuple[KeyPath, str]
"""The key of a mistake, and a sentence with the wrong and the expected value."""

_KEY_OF_NAME: Final[dict[str, KeyPath]] = {
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
    "choice": ("pareto", "choice"),
    "impact_force": ("impact",),
    "drive_force": ("impact",),
    "uncertainty": ("uncertainty",),
    "samples": ("robust", "samples"),
    "seed": ("robust", "seed"),
    "runs": ("verify", "runs"),
    "stability_margin": ("loop", "stability_margin"),
    "drag_effect": ("law",),
    **{name: ("law", name) for name in ("ratio", "excursion", "acceleration", "contact_speed", "largest_speed")},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioSource:
    """The scenario file of a design task.

    Args:
        path: path of the file.
        text: its text, which reports show.
        sha256: hash of its bytes, in hexadecimal.
        supported: sentence on the distances that the sensor's calibration supports; empty without a calibration.
        calibration_files: the files that were read for the calibration of the sensor.
        model_files: the file of the robot model, if there is one.
    """

    path: Path
    text: str = field(repr=False)
    sha256: str
    supported: str = field(default="", repr=False)
    calibration_files: tuple[Path, ...] = field(default=(), repr=False)
    model_files: tuple[Path, ...] = field(default=(), repr=False)

    @property
    def inputs(self) -> tuple[Path, ...]:
        """All files from which the task was read.

        pretouch refuses to overwrite these files.
        """
        return (self.path, *self.calibration_files, *self.model_files)

    @property
    def lines(self) -> Mapping[KeyPath, int]:
        """The line number of every key of the scenario file."""
        return _lines_of(self.text)

    def placed(self, error: InvalidInputError) -> InvalidInputError:
        """Add the line number in the scenario file to an error message."""
        if isinstance(error, ScenarioFileError):  # converted already by a nested verb
            return error
        message = self.explained(error)
        path, sentence = split_message(message, "")
        if path[:1] in self.lines:
            return self.refusal([(path, sentence)], **error.fields)
        return ScenarioFileError(f"{self.path}: {message}", argument=error.argument, **error.fields)

    def explained(self, error: InvalidInputError) -> str:
        """Return an error message with the calibrated range of distances.

        The range is added only if a distance is out of range.
        """
        return f"{error}; {self.supported}" if self.supported and isinstance(error, OutOfRangeError) else str(error)

    def refusal(self, mistakes: Iterable[Mistake], **fields: Any) -> ScenarioFileError:
        """Return the error that lists the mistakes in the scenario file by line number.

        Each mistake has its own line of text. A missing key has the line of its section, or else the last line. The
        fields of the error are those of the first mistake, without other `fields` the value in the file.
        """
        last = self.text.rstrip().count("\n") + 1
        rows = []
        for path, sentence in dict.fromkeys(mistakes):
            line = next((self.lines[path[:n]] for n in range(len(path), 0, -1) if path[:n] in self.lines), last)
            rows.append((path, FileMistake(line, _dotted(path), sentence)))
        rows.sort(key=lambda each: each[1].line)
        first_path, first = rows[0]
        fields = fields or {"value": _value_at(tomllib.loads(self.text), first_path)}
        texts = [f"{each.key}: {each.sentence}" if each.key else each.sentence for _, each in rows]
        return ScenarioFileError(
            "\n".join(f"{self.path}, line {each.line}: {text}" for (_, each), text in zip(rows, texts, strict=True)),
            argument=first.key,
            mistakes=(each for _, each in rows),
            **fields,
        )


_lines_of = lru_cache(maxsize=4)(key_lines)


def _value_at(content: Any, path: KeyPath) -> Any:
    """Return the value at a key of a parsed file; None if there is no such key."""
    for part in path:
        try:
            content = content[part]
        except (KeyError, IndexError, TypeError):
            return None
    return content


def _dotted(path: KeyPath) -> str:
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            name = part if re.fullmatch(r"[\w-]{1,60}", part) else repr(part[:60])
            text += f".{name}" if text else name
    return text


def split_message(message: str, section: str, keys: Iterable[str] = ()) -> Mistake:
    """Split an error message into key and sentence.

    The text before the colon is a key of `section`, one of `keys`, or a section followed by one of its keys.

    Returns:
        The known part of the key's path, and the sentence.

    Examples:
        >>> split_message("obstacle position: found a distance of 0 m", "")
        (('obstacle', 'position'), 'found a distance of 0 m')
        >>> split_message("mass: found -1 kg, which must be positive", "admittance")
        (('admittance', 'mass'), 'found -1 kg, which must be positive')
    """
    name, colon, sentence = message.partition(": ")
    if not colon:
        return ((section,) if section else ()), message
    words, key = name.split(" ", 1), name.replace(" ", "_")
    if section and (key in keys_of(section) or key in keys):
        return (section, key), sentence
    if len(words) == 2 and words[0] in SECTIONS and words[1].replace(" ", "_") in keys_of(words[0]):
        return (words[0], words[1].replace(" ", "_")), sentence
    if len(words) == 2 and words[0] == "constraint" and words[1] in keys_of("constraints"):
        return ("constraints", words[1]), sentence
    if section:
        return (section,), message
    return (_KEY_OF_NAME[name], sentence) if name in _KEY_OF_NAME else ((), message)


T = TypeVar("T")

_BY_KEYS: Final = {
    "admittance": ({"natural_frequency", "damping_ratio"}, "natural_frequency", "damping"),
    "impact": ({"radius", "effective_modulus"}, "radius", "stiffness"),
}
_TAGS: Final = {
    "sensor": "model",
    **dict.fromkeys(("objective", "robot", "contact", "tracking", "law"), "kind"),
}
"""The key that selects the variant of a section."""

_OTHER_TAGS: Final = {
    "sensor": (("model", CALIBRATION), ', or calibration = "sensor.csv"'),
    "robot": (("kind", MODEL), ', or model = "arm.xml"'),
}
"""Keys that select the variant of a section, if there are several, with a hint about the others."""


class Reading:
    """The values and mistakes in a scenario file.

    Args:
        source: the file.
        data: its content, parsed by `tomllib`.

    Attributes:
        law: the law, or its class, whose keys [law] has; None if [law] has a mistake. Sections that depend on the law
            are then not read.
    """

    def __init__(self, source: ScenarioSource, data: Mapping[str, Any]) -> None:
        self.source, self.data = source, data
        self.unread: list[Mistake] = list(_unknown_sections(data))
        self.mistakes: list[Mistake] = []
        self.sections: dict[str, tuple[Section, dict[str, Any]]] = {}
        self.arrays: dict[str, list[dict[str, Any]]] = {}
        # sections whose names are probably misspelled in the file
        self.misspelled = {nearest(name, SECTIONS) for name in data if name not in SECTIONS}
        law = data.get("law", {} if "law" in self.misspelled else {"kind": DAMPER.kind})
        self.law: Any = _law(law.get("kind") if isinstance(law, dict) else None)
        examples = required_sections(self.law or DAMPER, law if isinstance(law, dict) else ())
        for name in SECTIONS:
            if name in data:
                self._read(name, data[name])
            elif name in examples and name not in self.misspelled:
                self.unread.append(((name,), f"found no such section, expected [{name}] with {examples[name]}"))

    def _read(self, name: str, content: Any) -> None:
        """Read one section of the scenario file. The mistakes in the section are recorded."""
        if name in ARRAYS:
            self._read_array(name, content)
            return
        if not isinstance(content, dict):
            what = f"[[{name}]]" if isinstance(content, list) else value_text(content)
            self.unread.append(((name,), f"found {what}, expected a section [{name}] with keys"))
            return
        if name in OF_A_LAW and self.law is None:
            return
        variant = _variant(name, content, "" if self.law is None else self.law.kind)
        if not isinstance(variant, Section):
            self.unread.append(variant)
            return
        try:
            self.sections[name] = variant, variant(content, partial(_unknown_key, self.source, name, variant, content))
        except UnfitValueError as unfit:
            self.unread += [((name, *path), sentence) for path, sentence in unfit.mistakes]

    def _read_array(self, name: str, content: Any) -> None:
        """Read an array of tables of the scenario file."""
        try:
            self.arrays[name] = list_of(variants(name)[""], 1, None, ARRAYS[name])(content)
        except UnfitValueError as unfit:
            found = "" if isinstance(content, list) else f"found {value_text(content)}, "
            self.unread += [
                ((name, *path), sentence if path else f"{found}{sentence}") for path, sentence in unfit.mistakes
            ]

    def refuse(self, path: KeyPath, sentence: str) -> None:
        """Record a mistake at a key of the scenario file."""
        self.mistakes.append((path, sentence))

    def attempt(self, section: str, make: Callable[[], T], path: KeyPath = ()) -> T | None:
        """Call a function, and record its error as a mistake at `path`, or else at the key that the error names."""
        try:
            return make()
        except InvalidInputError as error:
            keys = self.sections[section][0].keys if section in self.sections else ()
            self.refuse(*((path, str(error)) if path else split_message(str(error), section, keys)))
            return None

    def values(self, section: str) -> dict[str, Any] | None:
        """Return the values of a section of the scenario file.

        The result is None if the section is missing or contains mistakes.
        """
        return self.sections[section][1] if section in self.sections else None

    def settings(self, section: str) -> dict[str, Any]:
        """Return the values of an optional section.

        If the section is missing, the values are the defaults.
        """
        return dict(self.sections[section][1]) if section in self.sections else variants(section)[""]({})

    def options(self, section: str) -> Any:
        """Return the options object for a scenario-file section.

        If the section is missing, the options have their default values.
        """
        if section in self.data:
            return self.make(section)
        variant: Any = _variant(section, {}, (self.law or DAMPER).kind)
        return variant.make(**variant({}))

    def make_each(self, section: str) -> tuple[Any, ...] | None:
        """Return the Python objects that an array of tables describes.

        The result is None if one of them contains mistakes, and empty without such tables.
        """
        if section not in self.data:
            return ()
        make: Any = variants(section)[""].make
        made = []
        for i, values in enumerate(self.arrays.get(section, ())):
            try:
                made.append(make(**values))
            except InvalidInputError as error:
                key, _, sentence = str(error).partition(": ")
                self.refuse((section, i, key), sentence)
        return tuple(made) if len(made) == len(self.data[section]) else None

    def make(self, section: str, without: tuple[str, ...] = ()) -> Any:
        """Return the Python object that a scenario-file section describes.

        The keys in `without` are ignored.
        """
        if section not in self.sections:
            return None
        variant, values = self.sections[section]
        make: Any = variant.make
        return self.attempt(section, lambda: make(**{k: v for k, v in values.items() if k not in without}))


def _law(kind: Any) -> Any:
    """Return the law with a given name, or its class; None if it does not exist or cannot be imported."""
    try:
        return LAW_KINDS.find(kind) if isinstance(kind, str) else None
    except InvalidInputError:  # reported when [law] is read
        return None


def _unknown_sections(data: Mapping[str, Any]) -> Iterator[Mistake]:
    """Yield a mistake for each unknown section. The mistake contains a suggested correction."""
    for name in data:
        if name in SECTIONS:
            continue
        homes = [f"[{section}]" for section in SECTIONS if name in keys_of(section)]
        near = nearest(name, SECTIONS)
        if not isinstance(data[name], (dict, list)) and homes:
            yield (
                (name,),
                f"this key is outside of all sections of the scenario file. The key belongs in {' or '.join(homes)}",
            )
        else:
            expected = f"[{near}]" if near else f"one of {', '.join(f'[{s}]' for s in SECTIONS)}"
            yield (name,), f"found an unknown section, expected {expected}"


def _variant(name: str, content: Mapping[str, Any], law: str) -> Section | Mistake:
    """Choose the set of allowed keys for a section. The result is a mistake if no such variant of the section fits."""
    if name == "sensor":
        curves = sensor_variants(foreign=True)
        calibrated = curves.pop(CALIBRATION)
        return calibrated if CALIBRATION in content else _named_variant(name, content, curves)
    choices = variants(name)
    if name == "robot":
        choices = dict(choices)
        modeled = choices.pop(MODEL)
        return modeled if MODEL in content else _named_variant(name, content, choices)
    if name in _TAGS:
        return _named_variant(name, content, choices)
    if name in _BY_KEYS:
        keys, with_them, without = _BY_KEYS[name]
        return choices[with_them if keys & set(content) else without]
    return choices[law if name in OF_A_LAW else ""]


def _named_variant(section: str, content: Mapping[str, Any], choices: Mapping[str, Section]) -> Section | Mistake:
    """Choose a section's variant by a key such as `kind`."""
    names = tuple(name for name in variants(section) if name not in {CALIBRATION, MODEL})
    key = _TAGS[section]
    if key in content:
        value = content[key]
        if isinstance(value, str) and value in choices:
            return choices[value]
        extensions = extensions_of(section)
        if extensions is not None:
            kinds, make = extensions
            try:
                extension = kinds.find(value) if isinstance(value, str) else None
            except InvalidInputError as error:
                return (section, key), f"found {value_text(value)}, but {error}"
            if extension is not None:
                return make(extension)
            names = kinds.names()
        return (section, key), f"found {value_text(value)}, {one_of(value, names)}"
    keys, alternative = _OTHER_TAGS.get(section, ((key,), ""))
    for unknown in content:
        near = nearest(unknown, keys) if unknown not in keys_of(section) else None
        if near:
            return (section, unknown), f'found an unknown key, expected "{near}"'
    return (section, key), f'missing, {one_of(None, names)}{alternative}; add, for example: {key} = "{names[0]}"'


def _unknown_key(source: ScenarioSource, name: str, variant: Section, content: Mapping[str, Any], key: str) -> str:
    """Write the error message about an unknown key. The message suggests the right key or section."""
    takes = ", ".join(variant.names)
    if key in keys_of(name):
        return _key_of_another_variant(source, name, takes, content, key)
    near = nearest(key, variant.names) or nearest(key, keys_of(name))
    if near:
        return f'found an unknown key, expected "{near}"'
    homes = [f"[{section}]" for section in SECTIONS if key in keys_of(section)]
    if homes:
        return f"found a key of {' or '.join(homes)}, expected only {takes} in [{name}]"
    return f"found an unknown key, expected one of {takes}"


_INSTEAD: Final = {
    ("controller", "gain"): 'drag = "0.0144 N*s²" in [law]',
    ("constraints", "gain"): "bounds in [gain]",
}


def _key_of_another_variant(source: ScenarioSource, name: str, takes: str, content: Mapping[str, Any], key: str) -> str:
    """Write the error message about a key of another section variant."""
    owners = [tag for tag, other in variants(name).items() if key in other.keys]
    if name == "sensor" and CALIBRATION in content:
        return (
            f"found a curve parameter together with a calibration (line {source.lines['sensor', CALIBRATION]}); "
            "give either a model with its parameters, or a calibration to fit"
        )
    if name == "sensor" and owners == [CALIBRATION]:
        return "this key belongs to a calibration, expected the key calibration as well"
    if name in OF_A_LAW:
        instead = _INSTEAD.get((name, key), f"only {takes}")
        return f'this key belongs to the law "{owners[0]}", but the scenario file uses another law; expected {instead}'
    if name in _TAGS:
        quoted = " and ".join(f'"{owner}"' for owner in owners)
        tag = _TAGS[name]
        selected = f'{tag} = "{content[tag]}"' if tag in content else f"the key {MODEL}"
        return (
            f"this key belongs to the variant {quoted} of this section, but {selected} selects another variant. In "
            f"the selected variant, the allowed keys are {takes}"
        )
    return f"found together with {', '.join(k for k in content if k != key)}, expected only {takes}"
