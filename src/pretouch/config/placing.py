"""Which key of a file the message of an InvalidInputError speaks of."""

from __future__ import annotations

from typing import Final

from .positions import KeyPath
from .schema import SECTIONS, keys_of

__all__ = ["place"]

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
}


def place(message: str, section: str) -> tuple[KeyPath, str]:
    """Split a message `name: found ..., which ...` into the key that it speaks of and the sentence.

    Args:
        message: the message of an error; its name may be a key of the section, or the words of a key.
        section: the section that was being built; empty where that is not known.

    Returns:
        The path of the key, as near as it is known, and the sentence; an empty path where nothing is known.

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
