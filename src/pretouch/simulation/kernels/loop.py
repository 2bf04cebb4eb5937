"""One encounter of the sampled loop, and many: sensor chain, controller at its own rate, plant and contact."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pretouch.control import Sample

from .mechanics import (
    advance,
    contact_force,
    contact_step,
    elastic_duration,
    first_touch,
    hermite,
    hermite_slope,
    resolution,
)
from .noise import mix
from .sensing import draw_misfit, exposed_to, instant_of, raw_reading, start_of

__all__ = ["encounters"]

_TINY = 1e-12  # s: instants that are closer are one


def step(parameters: Any, state: Any, sample: Any) -> Any:
    """Stand for the law, which takes this place when the loop is compiled."""
    raise NotImplementedError


def encounters(
    parameters: Any,
    initial: Any,
    scenes: Any,
    plant: Any,
    contact: Any,
    chain: Any,
    curve: Any,
    clock: Any,
    seed: Any,
    which: Any,
    draws: Any,
    out: Any,
    touches: Any,
    trace: Any,
    course: Any,
) -> None:
    """Run encounters that start in the same state of the same law.

    Args:
        parameters: those of the law.
        initial: state of the law at the start.
        scenes: position and velocity of the plant; position, velocity, acceleration of obstacle and reference; a row
            per encounter.
        plant: named by COEFFICIENTS.
        contact: stiffness, damping, exponent, whether damping grows with depth, 1 / mass of the obstacle (0: driven).
        chain: of the sensor, as SensorChain.numbers gives it.
        curve: table of ln xi, its first distance, its step, the largest distance.
        clock: period of the controller, step of the plant, horizon, time to follow a contact.
        seed: of the random numbers.
        which: indices of the encounters to run.
        draws: which run's noise each of all encounters meets.
        out: filled by RESULT_COLUMNS, a row per encounter.
        touches: filled by CONTACT_COLUMNS, a row per contact of each encounter.
        trace: filled by TRACE_COLUMNS, a row per period, as far as it has rows.
        course: filled by COURSE_COLUMNS, a row per touch and per step in contact, as far as it has rows.
    """
    period, plant_step, horizon, follow = clock
    table, low, spacing, high = curve
    ideal = plant[0] == 0.0
    inverse_mass = 0.0 if ideal else 1.0 / plant[0] + contact[4]
    apart_from = (0.0, 0.0, 1.0, False, contact[4])  # a stiff contact must not turn a step around before it is found
    delay, ranging = chain[3], chain[13]
    nodes = 3 if chain[2] > 0.0 else 1
    room = int((delay + 16.0 * chain[4] + chain[2] + period) * chain[0]) + 8
    waiting, ready, taken = np.zeros(room), np.zeros(room), np.zeros(room)
    steps = math.ceil(horizon / period - 1e-9)
    for n in range(which.size):
        key, end, marks = mix(seed, np.uint64(draws[which[n]])), out[which[n]], touches[which[n]]
        scene, waves = scenes[which[n]], draw_misfit(chain, key)
        x_start, v_start, xo_start, vo_start, ao = scene[0], scene[1], scene[2], scene[3], scene[4]
        xd_start, vd_start, ad = scene[5], scene[6], scene[7]
        body = (x_start, v_start, 0.0, xo_start, vo_start, 0.0)
        xv, vv = x_start, v_start

        head, tail = 0, 0
        k, node, total = 0, 0, 0.0
        start = start_of(chain, key, 0)
        instant = instant_of(chain, start, 0)

        touching, count, resolved = False, 0, plant_step
        touch_time, touch_impulse, touch_peak = 0.0, 0.0, 0.0
        end[:] = 0.0
        end[0], end[13], end[15] = 2.0, math.nan, math.nan
        end[6] = xo_start - x_start
        end[7] = abs(x_start - xd_start)
        end[9] = abs(v_start)
        flags, reading, measured = 0, 0.0, 0.0
        rate, acting = 0.0, 0.0
        state = initial
        rows, course_rows = 0, 0
        first, impact_end = math.nan, math.nan  # time of the first contact, and until when its forces are an impact

        for j in range(steps):
            t = j * period
            if instant <= _TINY and j == 0 and nodes == 1:  # a reading at the start, before anything has moved
                total = exposed_to(ranging, xo_start - x_start, table, low, spacing, high, waves)
                waiting[0] = raw_reading(chain, key, 0, total, 0.0, table, low, spacing, waves)
                ready[0], taken[0], tail, k = delay, 0.0, 1, 1
                total = 0.0
                start = max(start_of(chain, key, 1), 0.0)
                instant = start
            fresh = False
            while head < tail and ready[head % room] <= t + _TINY:
                value = waiting[head % room]
                if not math.isnan(value):
                    reading, measured, fresh = value, taken[head % room], True
                head += 1
            force = contact_force(contact, body[0] - body[3], body[1] - body[4])
            xd, vd = xd_start + t * (vd_start + 0.5 * ad * t), vd_start + ad * t
            sample = Sample(reading, fresh, max(t - measured, 0.0), -force, xd, vd, ad)
            state, output = step(parameters, state, sample)
            flags |= output.status
            if output.status & 1 and math.isnan(end[15]):
                end[15] = t
            if count == 0:
                end[10] = max(end[10], abs(output.virtual_force))
            if rows < trace.shape[0]:
                row = trace[rows]
                row[0], row[1], row[2], row[3], row[4] = t, body[3] - body[0], body[0], body[1], body[3]
                row[5], row[6], row[7], row[8] = xv, vv, output.virtual_force, force
                row[9], row[10], row[11] = reading, output.log_level, output.status
                rows += 1
            target = (period, xv, vv, output.position, output.velocity, output.acceleration)
            push = ao
            at = 0.0
            before, acting = body, output.virtual_force
            while at < period - _TINY:
                h = period - at
                if ideal:
                    elapsed = t + period
                    moved = (
                        output.position,
                        output.velocity,
                        0.0,
                        xo_start + elapsed * (vo_start + 0.5 * ao * elapsed),
                        vo_start + ao * elapsed,
                        0.0,
                    )
                else:
                    h = min(h, resolved if touching else plant_step)
                    moved = advance(body, at, h, target, plant, contact if touching else apart_from, push)
                if count == 0:  # the mean over a step: of the motion as it is, whatever the law reports
                    rate = (moved[1] - body[1]) / h
                    end[22] = max(end[22], abs(rate))
                gap, closing = body[3] - body[0], (body[4] - body[1]) * h
                gap_after, closing_after = moved[3] - moved[0], (moved[4] - moved[1]) * h
                part, least = 2.0, gap_after
                if not touching:
                    doubt = resolution(x_start, (xo_start, vo_start, ao), moved[0], t + at + h)
                    part, least = first_touch(gap, closing, gap_after, closing_after, doubt)
                hit = part <= 1.0
                if hit:
                    if ideal:
                        body = (
                            hermite(body[0], body[1] * h, moved[0], moved[1] * h, part),
                            hermite_slope(body[0], body[1] * h, moved[0], moved[1] * h, part) / h,
                            0.0,
                            hermite(body[3], body[4] * h, moved[3], moved[4] * h, part),
                            hermite_slope(body[3], body[4] * h, moved[3], moved[4] * h, part) / h,
                            0.0,
                        )
                        at += part * h
                    else:
                        h *= part
                        moved = advance(body, at, h, target, plant, apart_from, push) if h > 0.0 else body
                        gap_after, closing_after = moved[3] - moved[0], (moved[4] - moved[1]) * h
                        least = gap_after
                while instant <= t + at + h + _TINY and not (hit and ideal):
                    part = min(max((instant - t - at) / h, 0.0), 1.0) if h > 0.0 else 1.0
                    distance = hermite(gap, closing, gap_after, closing_after, part)
                    weight = 1.0 if nodes == 1 else (8.0 / 18.0 if node == 1 else 5.0 / 18.0)
                    total += weight * exposed_to(ranging, distance, table, low, spacing, high, waves)
                    node += 1
                    if node == nodes:
                        place = tail % room
                        waiting[place] = raw_reading(chain, key, k, total, instant, table, low, spacing, waves)
                        taken[place] = start + 0.5 * chain[2]
                        ready[place] = start + chain[2] + delay
                        tail += 1
                        node, total, k = 0, 0.0, k + 1
                        start = max(start_of(chain, key, k), start + chain[2])
                    instant = max(instant_of(chain, start, node) if nodes == 3 else start, instant)
                if hit and ideal:
                    end[6] = 0.0
                else:
                    body = moved
                    at += h
                    end[6] = min(end[6], least)
                now = t + at
                if count == 0:
                    away = xd_start + now * (vd_start + 0.5 * ad * now)
                    end[7] = max(end[7], abs(body[0] - away))
                    end[8] = max(end[8], abs(body[0] - x_start))
                    end[9] = max(end[9], abs(body[1]))
                if hit:
                    count += 1
                    touching, touch_time, touch_impulse, touch_peak = True, now, body[5], 0.0
                    if count == 1:
                        first = now
                        away = xd_start + now * (vd_start + 0.5 * ad * now)
                        end[0], end[1], end[2], end[3], end[4] = 0.0, now, body[0], body[1], body[0] - away
                        end[5] = body[4] - body[1]
                        end[20], end[21] = rate, acting
                    if count <= marks.shape[0]:
                        marks[count - 1, 0], marks[count - 1, 1] = now, body[4] - body[1]
                    if ideal:
                        break
                    # onto the surface, from some 1e-11 m beside it: a damper acts from the first instant on
                    body = (body[3], body[1], body[2], body[3], body[4], body[5])
                    touch_peak = contact_force(contact, 0.0, body[1] - body[4])  # which no later force need reach
                    end[11] = max(end[11], touch_peak)
                    speed = abs(body[4] - body[1])
                    if count == 1:
                        impact_end = now + elastic_duration(contact, inverse_mass, speed)
                    if now <= impact_end:
                        end[18] = max(end[18], touch_peak)
                    resolved = min(plant_step, contact_step(contact, inverse_mass, speed))
                    if course_rows < course.shape[0]:
                        moment = course[course_rows]
                        moment[0], moment[1], moment[2] = now, 0.0, body[4] - body[1]
                        moment[3] = contact_force(contact, 0.0, body[1] - body[4])
                        course_rows += 1
                elif touching:
                    force = contact_force(contact, body[0] - body[3], body[1] - body[4])
                    touch_peak = max(touch_peak, force)
                    end[11] = max(end[11], force)
                    if now <= impact_end:  # what comes later is a push
                        end[18] = max(end[18], force)
                    if course_rows < course.shape[0]:
                        moment = course[course_rows]
                        moment[0], moment[1], moment[2], moment[3] = now, body[3] - body[0], body[4] - body[1], force
                        course_rows += 1
                    apart = body[3] - body[0] > 0.0 and body[4] > body[1]
                    if count <= marks.shape[0]:
                        touch = marks[count - 1]
                        touch[2], touch[3], touch[5] = touch_peak, body[5] - touch_impulse, now - touch_time
                        touch[4] = body[4] - body[1] if apart else math.nan
                    if apart:
                        touching = False
                        if count == 1:
                            end[13] = body[4] - body[1]
            end[17] = t + at
            xv, vv = output.position, output.velocity
            if not (math.isfinite(body[0]) and math.isfinite(body[1])):
                end[0] = 4.0
                body = before
            if end[0] == 4.0 or (count and (ideal or end[17] - first >= follow)):
                break
        end[12], end[14], end[16] = body[5], count, flags
        if count == 0:  # the state in which it ended; a motion beyond all numbers is left where it was known last
            now = end[17] if end[0] == 2.0 else max(end[17] - period, 0.0)
            end[1], end[2], end[3], end[19] = now, body[0], body[1], body[3] - body[0]
            end[4] = body[0] - xd_start - now * (vd_start + 0.5 * ad * now)
            end[5], end[20], end[21] = body[4] - body[1], rate, acting
