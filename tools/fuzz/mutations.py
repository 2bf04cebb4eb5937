"""Mutations of files and command lines: what people mistype, what programs export, and what nobody would write."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

SENSORS = (
    '[sensor]\nmodel = "exponential-1"\nscale = 0.458\nrate = "-61 1/m"\n',
    '[sensor]\nmodel = "exponential-2"\nscale = 0.48\nrate = "-74 1/m"\ncurvature = "474 1/m^2"\n',
    '[sensor]\nmodel = "mittag-leffler"\nscale = 0.458\nrate = "-61 1/m"\norder = 0.9\n',
    '[sensor]\nmodel = "table"\ndistances = ["0 mm", "15 mm", "30 mm", "60 mm"]\noutputs = [1.0, 0.5, 0.2, 0.05]\n',
    '[sensor]\nmodel = "inverse-power"\nscale = 1e-5\ndistance_offset = "31.9 mm"\nexponent = 3.3\nrecess = "10 mm"\n',
    '[sensor]\ncalibration = "sensor.csv"\n',
)
ADDITIONS = (
    'obstacle.acceleration = "-0.1 m/s^2"',
    'plant.position = "1 mm"',
    'plant.velocity = "0.1 m/s"',
    'reference.position = "3 mm"',
    'reference.velocity = "-0.05 m/s"',
    'reference.acceleration = "0.2 m/s^2"',
    'motion.method = "integration"',
    'motion.method = "uniform-motion"',
    'motion.method = "closed-form"',
    'motion.horizon = "2 s"',
    'constraints.acceleration = "3 m/s^2"',
    'constraints.relative_velocity = "0.05 m/s"',
    'constraints.time = "0.3 s"',
    'constraints.gain = "1 N*s"',
    'sensor.minimum_distance = "1 mm"',
    'sensor.maximum_distance = "0.1 m"',
    'sensor.recess = "2 mm"',
    "admittance.damping_ratio_bounds = [0.5, 2.0]",
    'pareto.quantities = ["time", "relative_velocity", "acceleration"]',
    'pareto.choice = "-0.7 N*s"',
    'uncertainty.obstacle.velocity = { uniform = ["-0.5 m/s", "-0.1 m/s"] }',
    'uncertainty.admittance.mass = { interval = ["0.9 kg", "1.1 kg"] }',
    "uncertainty.sensor.exponent = { samples = [3.1, 3.3, 3.5] }",
    'robust.measure = "worst-case"',
    'robust.measure = "quantile"',
    "verify.runs = 50",
    "loop.stability_margin = 3.0",
    'loop.horizon = "0.2 s"',
    "controller.low_pass_order = 2",
    'controller.cutoff = "40 Hz"',
    'controller.timeout = "20 ms"',
    "controller.approach_only = true",
    "chain.dropout = 0.3",
    'chain.jitter = "1 ms"',
    "chain.measures_distance = true",
    'robot.bandwidth = "5 Hz"',
)
NUMBERS = (
    *(
        "0",
        "0.0",
        "-0.0",
        "1",
        "-1",
        "1e308",
        "-1e308",
        "1e-308",
        "5e-324",
        "1e154",
        "1e155",
        "1e-154",
        "1e-162",
        "1e16",
    ),
    *("nan", "inf", "-inf", "+inf", "1e400", "1e-400", "1_000", "0x10", "0b1", "1.", ".5", "1,5", "1e", "--1", "٣", ""),
    *("123456789012345678901234567890", "0.1e1", "1e+5", "1e-5", "2147483648", "9223372036854775808", "-5", "1e12"),
)
UNITS = (
    *(
        "",
        "m",
        "mm",
        "um",
        "nm",
        "km",
        "m/s",
        "mm/s",
        "N*s",
        "N",
        "kg",
        "g",
        "N/m",
        "N*s/m",
        "rad/s",
        "Hz",
        "kHz",
        "GHz",
    ),
    *("s", "ms", "us", "h", "%", "counts", "V", "mV", "1/m", "m^2", "m^99", "furlong", "m/", "*", "m s/kg", "°", "in"),
)
VALUES = (
    *(
        "true",
        "false",
        "[]",
        "{}",
        '""',
        '"text"',
        "[1, 2]",
        "[[1]]",
        "{ a = 1 }",
        "1979-05-27",
        "07:32:00",
        '"\\u0000"',
    ),
    *(
        "'''a\nb'''",
        "[1, 'a', true]",
        '"auto"',
        '"fit"',
        '"zero"',
        '"none"',
        '"0"',
        '"1 2 m"',
        "nan",
        "-inf",
        "0",
        "1e999",
    ),
    *(
        '["-10 N*s", "-0.01 N*s"]',
        '["0 N*s", "1 N*s"]',
        '["-1 N*s", "1 N*s"]',
        '"' + 3000 * "x" + '"',
        "[" + 300 * "1," + "]",
    ),
)
WORDS = (
    *(
        "excursion",
        "time",
        "custom",
        "expected",
        "quantile",
        "tail-mean",
        "worst-case",
        "ideal",
        "impedance",
        "position",
    ),
    *("inverse-power", "exponential-1", "exponential-2", "mittag-leffler", "table", "spring-damper", "hunt-crossley"),
    *("VCNL4010", "VL6180X", "auto", "integration", "uniform-motion", "closed-form", "obstacle speed", "displacement"),
    *("relative_velocity", "velocity", "acceleration", "impact_force", "virtual_force", "largest_excursion", "random"),
)
CHARACTERS = (
    "\0",
    "\x1b[2J",
    "\ufeff",
    "µ",
    "∞",
    "\u202e",
    "'",
    '"',
    "#",
    "=",
    "[",
    "]",
    "{",
    ",",
    "\n",
    "\t",
    "é",
    "𝄞",
    "\\",
)


class Dice:
    """Random choices that repeat with their seed."""

    def __init__(self, *seed: int) -> None:
        self._generator = np.random.default_rng(seed)

    def pick(self, items: Any) -> Any:
        return items[int(self._generator.integers(len(items)))]

    def number(self, low: int, high: int) -> int:
        return int(self._generator.integers(low, high + 1))

    def power(self, decades: float) -> float:
        return 10.0 ** min(float(self._generator.uniform(-decades, decades)), 300.0)

    def chance(self, probability: float) -> bool:
        return bool(self._generator.random() < probability)


_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_UNIT = re.compile(r'(?<=\d )[A-Za-z%][\w*/^.]*(?=")')
_KEY = re.compile(r"(?m)^[\w.]+(?= =)")
_LINE = re.compile(r"(?m)^[\w.]+ = .*$")
_VALUE = re.compile(r"(?m)(?<= = )[^#\n]+")
_HEAD = re.compile(r"(?m)^\[\w+\]$")
_WORD = re.compile(r'(?<=")[a-zA-Z][\w -]*(?=")')


def _replace(text: str, pattern: re.Pattern[str], dice: Dice, new: Callable[[str], str]) -> str:
    """Replace one match of a pattern, chosen at random."""
    found = list(pattern.finditer(text))
    if not found:
        return text
    match = dice.pick(found)
    return text[: match.start()] + new(match.group()) + text[match.end() :]


def _scaled(number: str, factor: float) -> str:
    return repr(float(number) * factor) if "_" not in number else number


def extreme_number(text: str, dice: Dice) -> str:
    return _replace(text, _NUMBER, dice, lambda _: dice.pick(NUMBERS))


def other_scale(text: str, dice: Dice) -> str:
    return _replace(text, _NUMBER, dice, lambda n: _scaled(n, dice.power(9.0)))


def near_scale(text: str, dice: Dice) -> str:
    return _replace(text, _NUMBER, dice, lambda n: _scaled(n, dice.power(1.5)))


def other_sign(text: str, dice: Dice) -> str:
    return _replace(text, _NUMBER, dice, lambda n: n[1:] if n[0] in "+-" else f"-{n}")


def other_unit(text: str, dice: Dice) -> str:
    return _replace(text, _UNIT, dice, lambda _: dice.pick(UNITS))


def other_value(text: str, dice: Dice) -> str:
    return _replace(text, _VALUE, dice, lambda _: dice.pick(VALUES))


def other_word(text: str, dice: Dice) -> str:
    return _replace(text, _WORD, dice, lambda _: dice.pick(WORDS))


def another_key(text: str, dice: Dice) -> str:
    keys = _KEY.findall(text)
    return _replace(text, _KEY, dice, lambda _: dice.pick(keys))


def misspelt(text: str, dice: Dice) -> str:
    def spoil(word: str) -> str:
        at = dice.number(0, len(word) - 1)
        return word[:at] + dice.pick(["", word[at] * 2, "x", word[at].upper(), "-", "."]) + word[at + 1 :]

    return _replace(text, dice.pick([_KEY, _HEAD, _WORD]), dice, spoil)


def without_a_line(text: str, dice: Dice) -> str:
    return _replace(text, _LINE, dice, lambda _: "")


def a_line_twice(text: str, dice: Dice) -> str:
    return _replace(text, _LINE, dice, lambda line: f"{line}\n{line}")


def moved_line(text: str, dice: Dice) -> str:
    lines = _LINE.findall(text)
    if not lines:
        return text
    line = dice.pick(lines)
    return _replace(text.replace(line, "", 1), _LINE, dice, lambda other: f"{other}\n{line}")


def without_a_section(text: str, dice: Dice) -> str:
    parts = re.split(r"(?m)^(?=\[)", text)
    parts.pop(dice.number(0, len(parts) - 1))
    return "".join(parts)


def a_section_twice(text: str, dice: Dice) -> str:
    parts = re.split(r"(?m)^(?=\[)", text)
    return text + "\n" + dice.pick(parts)


def swapped_sections(text: str, dice: Dice) -> str:
    parts = re.split(r"(?m)^(?=\[)", text)
    i, j = dice.number(0, len(parts) - 1), dice.number(0, len(parts) - 1)
    parts[i], parts[j] = parts[j], parts[i]
    return "\n".join(parts)


def other_head(text: str, dice: Dice) -> str:
    heads = [
        "[[gain]]",
        "[sensor.x]",
        "[]",
        "[gain",
        "[a b]",
        "[chain]",
        "[loop]",
        '["gain"]',
        "[uncertainty]",
        "[impact]",
    ]
    return _replace(text, _HEAD, dice, lambda _: dice.pick(heads))


def another_sensor(text: str, dice: Dice) -> str:
    return re.sub(r"(?s)\[sensor\].*?(?=^\[|\Z)", dice.pick(SENSORS).replace("\\", r"\\"), text, count=1, flags=re.M)


def addition(text: str, dice: Dice) -> str:
    """Add a key that makes sense to its section."""
    path, _, value = dice.pick(ADDITIONS).partition(" = ")
    section, _, key = path.partition(".")
    line = f"{key} = {value}\n"
    text = re.sub(rf"(?m)^{re.escape(key)} = .*\n", "", text)
    if f"[{section}]\n" in text:
        return text.replace(f"[{section}]\n", f"[{section}]\n{line}", 1)
    return f"{text}\n[{section}]\n{line}"


def broken_character(text: str, dice: Dice) -> str:
    at = dice.number(0, len(text))
    return text[:at] + dice.pick(CHARACTERS) + text[at + dice.number(0, 1) :]


def truncated(text: str, dice: Dice) -> str:
    return text[: dice.number(0, len(text))]


def line_ends(text: str, dice: Dice) -> str:
    return text.replace("\n", dice.pick(["\r\n", "\r", "\n\r", "\n\n", "\u2028"]))


def other_header(text: str, dice: Dice) -> str:
    head, _, rest = text.partition("distance [mm],output [counts]")
    titles = (
        "distance [mm]",
        "distance",
        "distance [V]",
        "l [m]",
        "output [counts]",
        "output [V]",
        "xi",
        "day",
        "",
        "7",
        "x [um]",
    )
    return f"{head}{dice.pick(titles)},{dice.pick(titles)}{dice.pick(['', ',day', ',,', ','])}{rest}"


def other_delimiter(text: str, dice: Dice) -> str:
    return text.replace(",", dice.pick([";", "\t", " ", "|", ",,", " , ", ":"]))


def decimal_commas(text: str, dice: Dice) -> str:
    return text.replace(",", ";").replace(".", ",") if dice.chance(0.8) else text.replace(".", ",")


def _rows(text: str, change: Callable[[list[str]], list[str]]) -> str:
    head, rows = text.split("\n")[:2], text.split("\n")[2:]
    return "\n".join([*head, *change(rows)])


def fewer_rows(text: str, dice: Dice) -> str:
    step, first = dice.number(2, 40), dice.number(0, 20)
    return _rows(text, lambda rows: rows[first::step])


def shuffled_rows(text: str, dice: Dice) -> str:
    return _rows(text, lambda rows: [dice.pick(rows) for _ in rows] if rows else rows)


def a_row_of_extremes(text: str, dice: Dice) -> str:
    return f"{text}\n{dice.pick(NUMBERS)},{dice.pick(NUMBERS)}\n"


def scaled_column(text: str, dice: Dice) -> str:
    column, factor = dice.number(0, 1), dice.power(dice.pick([3.0, 160.0, 320.0]))

    def scale(row: str) -> str:
        cells = row.split(",")
        if len(cells) > column and _NUMBER.fullmatch(cells[column]):
            cells[column] = _scaled(cells[column], factor)
        return ",".join(cells)

    return _rows(text, lambda rows: [scale(row) for row in rows])


def constant_column(text: str, dice: Dice) -> str:
    column, value = dice.number(0, 1), dice.pick(NUMBERS)

    def fill(row: str) -> str:
        cells = row.split(",")
        return ",".join(value if i == column else cell for i, cell in enumerate(cells))

    return _rows(text, lambda rows: [fill(row) for row in rows])


def no_object_rows(text: str, dice: Dice) -> str:
    words = ("inf", "", "none", "no object", "nan", "-")
    return text + "".join(
        f"\n{dice.pick(words)},{dice.pick([*NUMBERS[:6], '20', '21', '19'])}" for _ in range(dice.number(1, 9))
    )


def turned(text: str, dice: Dice) -> str:
    """Name columns by distance, with a row for every repeat."""
    found: dict[str, list[str]] = {}
    for row in text.split("\n")[2:]:
        distance, comma, output = row.partition(",")
        if comma:
            found.setdefault(distance, []).append(output)
    unit, mark = dice.pick([" mm", "mm", "cm", "", " V"]), dice.pick([",", ";", "\t", " ", "  "])
    corner = dice.pick(["", "", "distance [mm]", "output [counts]", "trial", "sensor", "mm", "7"])
    heads = [f"{distance}{unit}" if _NUMBER.fullmatch(distance) else distance for distance in found]
    longest = max((len(cells) for cells in found.values()), default=0)
    missing = dice.pick(["", "nan"])
    cells = [[*column, *[missing] * (longest - len(column))] for column in found.values()]
    rows = [mark.join(heads), *(mark.join(row) for row in zip(*cells, strict=True))]
    first = [corner, *(dice.pick([str(i), str(i), "a", ""]) for i in range(1, len(rows)))]
    return "\n".join(f"{a}{mark}{row}" if corner else row for a, row in zip(first, rows, strict=True)) + "\n"


def between_blanks(text: str, dice: Dice) -> str:
    return re.sub(",", lambda _: " " * dice.number(1, 4), text)


def text_above(text: str, dice: Dice) -> str:
    above = (
        "Sensor X",
        "Operator: Smith, J.",
        "Range;80 cm",
        "Gain,8",
        "1,2",
        "0 5",
        "sep=;",
        "x",
        ",,",
        "distance",
        "# a",
    )
    return "\n".join([*(dice.pick(above) for _ in range(dice.number(1, 5))), text.partition("\n")[2]])


def another_column(text: str, dice: Dice) -> str:
    """Add a setting, a count, a second output or a label."""
    names = (
        "current [mA]",
        "gain",
        "temperature",
        "trial",
        "",
        "output [counts]",
        "output",
        "range [mm]",
        "day",
        "time",
    )
    kind = dice.pick(["counted", "constant", "random"])
    rows = text.split("\n")
    found = [*rows[:1], *(f"{row},{dice.pick(names)}" for row in rows[1:2])]
    for i, row in enumerate(rows[2:]):
        value = {"counted": i, "constant": 8, "random": dice.number(0, 9)}[kind]
        found.append(f"{row},{value}" if row else row)
    return "\n".join(found)


def quoted(text: str, dice: Dice) -> str:
    return _replace(
        text, _NUMBER, dice, lambda n: dice.pick([f'"{n}"', f'"{n}', f'{n}"', f"'{n}'", f" {n} ", f"{n} mm"])
    )


SCENARIO_MUTATIONS = (
    *(
        extreme_number,
        extreme_number,
        other_scale,
        other_scale,
        other_scale,
        near_scale,
        near_scale,
        other_sign,
        other_unit,
    ),
    *(
        other_value,
        other_word,
        another_key,
        misspelt,
        without_a_line,
        without_a_line,
        a_line_twice,
        moved_line,
        addition,
    ),
    *(
        addition,
        addition,
        another_sensor,
        another_sensor,
        without_a_section,
        a_section_twice,
        swapped_sections,
        other_head,
    ),
    *(broken_character, truncated, line_ends),
)
TABLE_MUTATIONS = (
    *(
        extreme_number,
        extreme_number,
        other_scale,
        near_scale,
        other_sign,
        other_header,
        other_delimiter,
        decimal_commas,
    ),
    *(fewer_rows, shuffled_rows, a_row_of_extremes, scaled_column, constant_column, no_object_rows, quoted),
    *(turned, turned, between_blanks, text_above, another_column),
    *(broken_character, truncated, line_ends),
)


def encoded(text: str, dice: Dice) -> bytes:
    """Turn a text into bytes, now and then in another encoding or with bytes of none."""
    if not dice.chance(0.04):
        return text.encode("utf-8", "replace")
    how = dice.pick(["utf-8-sig", "utf-16", "utf-16-le", "latin-1", "bad", "zero", "cut"])
    if how in {"bad", "zero", "cut"}:
        content = text.encode("utf-8", "replace")
        at = dice.number(0, len(content))
        return content[:at] + {"bad": b"\xff\xfe\x80", "zero": b"\0", "cut": b"\xc3"}[how] + content[at:]
    return text.encode(how, "replace")


@dataclass(frozen=True, kw_only=True)
class Case:
    """One command with its files, as a list of mutations that can be left out one by one.

    Args:
        verb: the verb.
        scenario: name of the scenario file; empty for `fit`.
        changes: for each mutation the file that it changes, its place in the list of mutations, and its seed.
        arguments: what follows the file on the command line.
        seed: of the encoding.
    """

    verb: str
    scenario: str
    changes: tuple[tuple[str, int, tuple[int, ...]], ...]
    arguments: tuple[str, ...]
    seed: tuple[int, ...]

    def files(self) -> dict[str, bytes]:
        """Return the files of the case by name."""
        names = ["sensor.csv", *([self.scenario] if self.scenario else [])]
        found = {}
        for name in names:
            text = (EXAMPLES / name).read_text(encoding="utf-8")
            mutations = TABLE_MUTATIONS if name.endswith(".csv") else SCENARIO_MUTATIONS
            touched = False
            for file, which, seed in self.changes:
                if file == name:
                    text, touched = mutations[which](text, Dice(*seed)), True
            found[name] = encoded(text, Dice(*self.seed)) if touched else text.encode()
        return found

    @property
    def command(self) -> tuple[str, ...]:
        """The command line after the name of the program."""
        file = self.scenario or ("" if self.verb == "reproduce" else "sensor.csv")
        return (self.verb, *([file] if file else []), *self.arguments)


VERBS = ("fit", "design", "design", "robust", "pareto", "sweep", "sweep", "simulate", "verify", "reproduce")
_SCENARIOS = {
    "design": ("approach.toml", "fingertip.toml", "robust.toml", "tradeoff.toml", "loop.toml", "drag.toml"),
    "robust": ("robust.toml", "robust.toml", "loop.toml"),
    "pareto": ("tradeoff.toml", "approach.toml", "fingertip.toml"),
    "sweep": ("approach.toml", "fingertip.toml", "tradeoff.toml", "drag.toml"),
    "simulate": ("loop.toml", "loop.toml", "drag.toml", "course.toml"),
    "verify": ("loop.toml", "loop.toml", "drag.toml"),
}
_AXES = (
    *(
        "obstacle.velocity=-1:-0.1:5",
        "obstacle.velocity=-1 m/s,-0.2 m/s",
        "admittance.mass=0.1:10:4:log",
        "gain=-2:-0.1:6",
    ),
    *("sensor.exponent=2:4:3", "obstacle.position=20 mm:60 mm:4", "admittance.damping=1:100:3", "sensor.recess=0,1 mm"),
    *("objective.displacement.weight=0.5,2", "constraint.excursion=0.1,0.3", "reference.velocity=-0.1,0.1", "gain=-1"),
)
_GAINS = (
    "-0.7 N*s",
    "-0.7",
    "0",
    "1 N*s",
    "-1e6 N*s",
    "-1e308",
    "1e-308",
    "nan",
    "inf",
    "-5e-324",
    "x",
    "",
    "1 m",
    "-50",
)
_IDS = (
    "table-1",
    "figure-3",
    "one-gain",
    "impact-force",
    "constraints",
    "attraction",
    "table-9",
    "",
    "TABLE-1",
    "-x",
    "nan",
    "figure-4",
    "figure-5",
    "figure-6",
    "table-2",
    "table-3",
)


def _spoiled(text: str, dice: Dice) -> str:
    """Mutate the text of an option, most often not at all."""
    if dice.chance(0.5):
        return text
    change = dice.pick([extreme_number, other_scale, near_scale, other_sign, broken_character, truncated])
    found: str = change(text, dice)
    return found.replace("\0", "?")


def _sweep_arguments(dice: Dice) -> list[str]:
    found = ["--json"] if dice.chance(0.5) else []
    for _ in range(1 if dice.chance(0.6) else 2):
        found += ["--axis", _spoiled(dice.pick(_AXES), dice)]
    if dice.chance(0.5):
        found += ["--gain", dice.pick(_GAINS)]
    if dice.chance(0.15):
        found += ["--result", dice.pick(["time", "largest_excursion", "impact_force", "drive_force", "x", "gain"])]
    if dice.chance(0.15):
        found += ["--output", dice.pick(["out.nc", "out.zarr", "out.txt", "nowhere/out.nc"])]
    if dice.chance(0.02):
        found += ["--figure", dice.pick(["out.png", "out.svg", "out.gif"])]
    return found


def _arguments(verb: str, dice: Dice) -> tuple[str, ...]:
    if verb == "sweep":
        return tuple(_sweep_arguments(dice))
    found = [] if dice.chance(0.03) else ["--no-report"] if dice.chance(0.6) else ["--json"]
    if verb == "robust":
        found += ["--samples", dice.pick(["64", "64", "64", "2", "0", "-1", "1e9", "100000000000000"])]
    elif verb == "verify":
        found += ["--runs", dice.pick(["8", "8", "8", "8", "1", "0", "1e3", "100000000000"])]
        found += [] if dice.chance(0.05) else ["--no-changes"]
    elif verb == "fit":
        options = (
            "--offset",
            "--saturation",
            "--near-field-peak",
            "--no-object",
            "--floor-sigmas",
            "--model",
            "--select",
            "--columns",
            "--labels",
        )
        values = (
            "auto",
            "fit",
            "zero",
            "none",
            "20",
            "20 counts",
            "1 V",
            "5 mm",
            "inverse-power",
            "day=1",
            "missing.csv",
            "3",
            "distance=1,output=2",
            "distance=[mm],output=[counts]",
            "output=output",
        )
        for _ in range(dice.pick([0, 0, 0, 1, 2])):
            found += [dice.pick(options), _spoiled(dice.pick(values), dice)]
    if verb in {"simulate", "verify"} and dice.chance(0.6):
        found += ["--gain", dice.pick(_GAINS)]
    if verb in {"simulate", "verify", "robust"} and dice.chance(0.2):
        found += ["--seed", dice.pick(["0", "1", "-1", "18446744073709551615", "18446744073709551616", "x"])]
    return tuple(found)


def make_case(seed: int, index: int, verb: str = "") -> Case:
    """Make a case that repeats with its seed and index, of any verb or of one."""
    dice = Dice(seed, index)
    verb = verb or dice.pick(VERBS)
    if verb == "reproduce" and not dice.chance(0.5):  # it reads no file: not so many
        verb = "simulate"
    scenario = dice.pick(_SCENARIOS[verb]) if verb in _SCENARIOS else ""
    changes = []
    for i in range(dice.pick([1, 1, 1, 2, 2, 3, 4])):
        table = verb == "fit" or (scenario == "fingertip.toml" and dice.chance(0.3))
        which = dice.number(0, len(TABLE_MUTATIONS if table else SCENARIO_MUTATIONS) - 1)
        changes.append(("sensor.csv" if table else scenario, which, (seed, index, i)))
    arguments = _arguments(verb, dice)
    if verb == "reproduce":
        changes, arguments = [], (*(dice.pick(_IDS) for _ in range(dice.number(1, 2))), *arguments)
    elif dice.chance(0.03):  # no input is ever written over
        inputs = ([scenario] if scenario else []) + (["./sensor.csv"] if scenario in {"", "fingertip.toml"} else [])
        arguments = (*arguments, "--output", dice.pick(inputs), "--force")
    return Case(verb=verb, scenario=scenario, changes=tuple(changes), arguments=arguments, seed=(seed, index, 99))
