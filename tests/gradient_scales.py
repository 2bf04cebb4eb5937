"""What derivatives of contacts are compared with: natural scales of every input and sizes of every quantity."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from encounters import Encounters
from pretouch.sensors import SensorModel


def scales_of(e: Encounters, sensor: SensorModel, time: np.ndarray) -> dict[str, np.ndarray]:
    """By how much each input changes the motion by its own size, about."""
    s, one = e.scenario, np.ones(len(e.gain))
    mass = s.admittance.mass * one
    length = s.distance * one
    speed = np.maximum(np.abs(s.relative_velocity * one), length / time)
    rate = np.maximum(speed / length, 1 / time)
    scales = {
        "gain": np.abs(e.gain) + mass * rate / 80,
        "admittance.mass": mass,
        "admittance.damping": s.admittance.damping * one + mass * rate,
        "admittance.stiffness": s.admittance.stiffness * one + mass * rate**2,
    }
    for body in ("obstacle", "plant", "reference"):
        scales |= {f"{body}.position": length, f"{body}.velocity": speed, f"{body}.acceleration": speed * rate}
    scales["sensor.recess"] = 0.01 * one
    for f in fields(getattr(sensor, "sensor", sensor)):
        if "unit" in f.metadata:
            scales[f"sensor.{f.name}"] = abs(getattr(getattr(sensor, "sensor", sensor), f.name)) * one
    return scales


def sizes_of(e: Encounters, sensor: SensorModel, time: np.ndarray) -> dict[str, np.ndarray]:
    """What an error of each quantity is to be compared with, where it is small itself."""
    length = e.scenario.distance
    speed = np.maximum(np.abs(e.scenario.relative_velocity), length / time)
    coupling = np.abs(e.gain * sensor.log_slope(0.0))
    force = coupling * speed
    admittance = e.scenario.admittance
    return {
        "time": time,
        "position": length,
        "velocity": speed,
        "acceleration": (force + admittance.damping * speed + admittance.stiffness * length) / admittance.mass,
        "displacement": length,
        "relative_velocity": speed,
        "virtual_force": force,
    }
