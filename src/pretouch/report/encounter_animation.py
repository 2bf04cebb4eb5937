"""Animate robot and object in an HTML report without JavaScript.

The animation runs in slow motion or in real time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Final, NamedTuple

import numpy as np

from pretouch._core.numbers import FloatArray
from pretouch._core.units import format_quantity
from pretouch.motion import Obstacle
from pretouch.sensors import SensorModel

_FRAMES: Final = 48
_WATCHED: Final = 4.0  # s that the slow motion should last about
_SLOWER: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
_HELD: Final = 0.25  # of the shown time: how long the last frame stays
_SHORTEST: Final = 1e-6  # s of an animation, so that contact at the start has one as well
_WIDTH: Final = 640
_LEFT: Final = 92.0  # space left of the robot's surface
_RIGHT: Final = 60.0  # space right of the object's surface
_OBJECT: Final = 22.0  # radius of the object and its outline
_LANE: Final = 96
_DARKEST: Final = 0.6  # opacity of the sensor field at the robot
_LEGEND: Final = (
    "The robot, the object, the distance between them (line) and the speed at which it shrinks (bar). The shading in "
    "front of the robot is the sensor output at each distance."
)
_COLORS: Final = ("var(--blue)", "var(--red)")


class Lane(NamedTuple):
    """Motion of robot and object in one row of an animation.

    Args:
        label: what distinguishes the run, such as its gain.
        style: number of the line style and color that figures give to the run.
        time: t [s], increasing, shape (n,).
        distance: distance between robot and object [m], shape (n,).
        position: position of the robot's surface [m], shape (n,).
        speed: speed at which the distance shrinks [m/s], shape (n,).
        ends_with_contact: whether the last sample is the contact.
    """

    label: str
    style: int
    time: FloatArray
    distance: FloatArray
    position: FloatArray
    speed: FloatArray
    ends_with_contact: bool


def lane(
    label: str,
    style: int,
    obstacle: Obstacle,
    *,
    time: FloatArray,
    distance: FloatArray,
    relative_velocity: FloatArray,
    ends_with_contact: bool,
) -> Lane:
    """Compute one row of the animation from distance and object motion.

    Args:
        label: what distinguishes the run.
        style: number of the line style and color that figures give to the run.
        obstacle: the approaching object.
        time: t [s].
        distance: l [m].
        relative_velocity: l' [m/s].
        ends_with_contact: whether the last sample is the contact.

    Returns:
        The row.
    """
    position = obstacle.position_at(time) - distance
    return Lane(label, style, time, distance, position, -relative_velocity, ends_with_contact)


def encounter_animation(lanes: Sequence[Lane], sensor: SensorModel) -> str:
    """Return an HTML animation of several runs of one encounter.

    Readers can choose the playback speed. The animation consists of SVG shapes and CSS keyframes. On systems with the
    setting "reduced motion", and in print, the shapes show the last sample of each run.

    Args:
        lanes: the runs, drawn one below the other on the same scale and with the same clock.
        sensor: the sensor curve, whose output is the opacity of the sensor field.

    Returns:
        The HTML elements.
    """
    shown = max(_SHORTEST, *(float(lane.time[-1]) for lane in lanes))
    slower = min(_SLOWER, key=lambda factor: abs(math.log(factor * shown / _WATCHED)))
    near = min(float(lane.position.min()) for lane in lanes)
    far = max(float((lane.position + lane.distance).max()) for lane in lanes)
    fastest = max(float(np.abs(lane.speed).max()) for lane in lanes) or 1.0
    scale = (_WIDTH - _LEFT - _RIGHT) / max(far - near, 1e-9)
    rules: list[str] = []
    shapes = [
        _lane(i, lane, rules, scale=scale, near=near, far=far, fastest=fastest, end=shown)
        for i, lane in enumerate(lanes)
    ]
    stops = _field_stops(sensor, far - near)
    whole = shown * (1 + _HELD)
    name = f"Animation of robot and object, {slower} times slower than the encounter" if slower > 1 else "Animation"
    choices = {"slow": f"{slower} times slower", "real": "real time", "still": "stopped"}
    if slower == 1:
        del choices["slow"]
    inputs = "".join(
        f'<input type="radio" name="encounter-clock" id="encounter-{key}"{" checked" if i == 0 else ""}>'
        f'<label for="encounter-{key}">{words}</label>'
        for i, (key, words) in enumerate(choices.items())
    )
    style = (
        f".encounter .moves {{ animation: {slower * whole:.4g}s linear infinite; }}\n"
        f"#encounter-real:checked ~ svg .moves {{ animation-duration: {whole:.4g}s; }}\n"
        "#encounter-still:checked ~ svg .moves { animation-play-state: paused; }\n"
        f"{''.join(rules)}"
        "@media print, (prefers-reduced-motion: reduce) { .encounter .moves { animation: none !important; } }"
    )
    return (
        f'<div class="encounter" role="group" aria-label="{name}"><style>{style}</style>{inputs}'
        f'<svg viewBox="0 0 {_WIDTH} {_LANE * len(lanes)}" role="img" aria-label="{name}">'
        f'<defs><linearGradient id="encounter-field">{stops}</linearGradient></defs>{"".join(shapes)}</svg>'
        f'<p class="note">{_LEGEND}</p></div>'
    )


def _lane(
    number: int, lane: Lane, rules: list[str], *, scale: float, near: float, far: float, fastest: float, end: float
) -> str:
    """Return the SVG shapes of one run. The CSS keyframes that move these shapes are appended to `rules`."""
    times = np.linspace(0.0, end, _FRAMES)
    distance = np.maximum(np.interp(times, lane.time, lane.distance), 0.0)
    surface = _LEFT + scale * (np.interp(times, lane.time, lane.position) - near)
    speed = np.abs(np.interp(times, lane.time, lane.speed)) / fastest
    moves = {
        "robot": [f"translateX({x:.1f}px)" for x in surface],
        "object": [f"translateX({x:.1f}px)" for x in surface + scale * distance],
        "distance": [
            f"translateX({x:.1f}px) scaleX({width:.1f})" for x, width in zip(surface, scale * distance, strict=True)
        ],
        "speed": [f"scaleX({v:.3f})" for v in speed],
    }
    for name, steps in moves.items():
        shares = np.append(100 * times / end / (1 + _HELD), 100.0)
        places = zip(shares, [*steps, steps[-1]], strict=True)
        frames = " ".join(f"{at:.4g}% {{ transform: {step}; }}" for at, step in places)
        rules.append(f"@keyframes encounter-{name}-{number} {{ {frames} }}\n")
    reach, middle, color = scale * (far - near), _LANE * number + 44, _COLORS[lane.style]

    def moving(name: str) -> str:
        return f'class="moves" style="animation-name: encounter-{name}-{number}; transform: {moves[name][-1]}"'

    return (
        f'<text x="8" y="{middle - 24}" fill="var(--ink)">{escape(lane.label)}: {escape(_ending(lane))}</text>'
        f'<g {moving("robot")}><polygon fill="url(#encounter-field)" points="0,{middle - 5} {reach:.0f},{middle - 20} '
        f'{reach:.0f},{middle + 20} 0,{middle + 5}"/>'
        f'<path fill="var(--quiet)" d="M{-_WIDTH} {middle - 8}h{_WIDTH - 24}v-10h24v36h-24v-10h{24 - _WIDTH}z"/></g>'
        f'<circle {moving("object")} cx="{_OBJECT}" cy="{middle}" r="{_OBJECT - 4}" fill="{color}"/>'
        f'<rect {moving("distance")} y="{middle + 24}" width="1" height="2" fill="var(--ink)"/>'
        f'<text x="8" y="{middle + 44}" fill="var(--quiet)">speed</text>'
        f'<g transform="translate({_LEFT:.0f} {middle + 35})"><rect {moving("speed")} '
        f'width="{_WIDTH - _LEFT - _RIGHT:.0f}" height="8" fill="{color}"/></g>'
    )


def _ending(lane: Lane) -> str:
    if not lane.ends_with_contact:
        return "no contact"
    speed = format_quantity(abs(float(lane.speed[-1])), "m/s", 3)
    return f"contact at {speed} after {format_quantity(float(lane.time[-1]), 's', 3)}"


def _field_stops(sensor: SensorModel, reach: float) -> str:
    """Return the color gradient of the area in front of the sensor."""
    distances = np.clip(np.linspace(0.0, reach, 9), *sensor.valid_range)
    with np.errstate(all="ignore"):
        level = np.asarray(sensor.log_output(distances), dtype=float)
        opacity = np.nan_to_num(_DARKEST * np.exp(np.clip(level - level[0], -6.0, 0.0)))
    return "".join(
        f'<stop offset="{i / 8:.3g}" stop-color="var(--blue)" stop-opacity="{value:.3f}"/>'
        for i, value in enumerate(opacity)
    )
