# SPDX-License-Identifier: Apache-2.0
"""Rare events of vehicles whose probabilities are known, and one of an autopilot.

A sphere without weight in linear drag: its place at the end is linear in its start and in the forces on it, so that what is
normal stays normal. Closed forms are those of the differential equation; steps of 0.05 s move probabilities by less than 1 %.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtri
from scipy.stats import chi2

import lgvi_warp as lw
from benchmarks.pages import ROOT

DRAG, T1, H = 20.0, 3.0, 0.05
RUN = {"method": "psi_x", "h": H, "t1": T1, "threads": 1}
VEHICLE = lw.Scene.named("sphere").vehicle
# Of the water, too: m + m / 2. A speed v leads to WAY v.
MASS = 1.5 * float(VEHICLE.mass)
TAU = MASS / DRAG
WAY = TAU * -math.expm1(-T1 / TAU)
# Standard deviations of place, speed, force and force's noise.
PLACE, SPEED, FORCE, NOISE = 0.5, 0.3, 60.0, 30.0
# Of one entry of the place, which all entries share.
SPREAD = math.hypot(PLACE, SPEED * WAY)


@dataclass(frozen=True)
class Event:
    """An event of a scene. limit: of (n, 3) places -> (n,), above 0 where it happens."""

    fleet: lw.Ensemble
    limit: Callable[[np.ndarray], np.ndarray]

    def of(self, result: Any) -> np.ndarray:
        """The limit of the members of a Result."""
        return self.limit(result.samples["position"][-1])


def one_side(p: float) -> Event:
    return Event(_starts(), lambda x: x[:, 0] / SPREAD + ndtri(p))


def two_sides(p: float) -> Event:
    return Event(_starts(), lambda x: np.abs(x[:, 0]) / SPREAD + ndtri(p / 2.0))


def unequal_sides(p: float) -> Event:
    ends = ndtri(0.62 * p), ndtri(0.38 * p)
    return Event(_starts(), lambda x: np.maximum(x[:, 0] / SPREAD + ends[0], -x[:, 0] / SPREAD + ends[1]))


def leaving_a_ball(p: float) -> Event:
    radius = math.sqrt(chi2.isf(p, 3))
    return Event(_starts(), lambda x: np.sqrt((x**2).sum(axis=1)) / SPREAD - radius)


def of_20_inputs(p: float) -> Event:
    return _gusts(20, p)


def of_60_gusts(p: float) -> Event:
    return _gusts(60, p)


def of_white_noise(p: float) -> Event:
    noise = lw.terms.WrenchNoise(force=(NOISE, 0.0, 0.0))
    fleet = lw.Ensemble(_scene(noise), vary={"start.position[0]": lw.distributions.Normal(std=PLACE)})
    # The integral of (tau (1 - exp(-s / tau)) S / m)^2 over s = 0 to T.
    gone = T1 - 2.0 * WAY + 0.5 * TAU * -math.expm1(-2.0 * T1 / TAU)
    spread = math.hypot(PLACE, TAU * NOISE / MASS * math.sqrt(gone))
    return Event(fleet, lambda x: x[:, 0] / spread + ndtri(p))


def _scene(*more: lw.terms.Term) -> lw.Scene:
    return lw.Scene(VEHICLE, terms=[lw.terms.Drag(linear=[DRAG] * 3 + [1.0] * 3), *more])


def _starts() -> lw.Ensemble:
    normal = lw.distributions.Normal
    return lw.Ensemble(
        _scene(), vary={"start.position": normal(std=[PLACE] * 3), "start.velocity": normal(std=[SPEED] * 3)}
    )


def _gusts(count: int, p: float) -> Event:
    """Forces along one axis at times as far apart, and lines between them."""
    times = np.linspace(0.0, T1, count + 1)
    gusts = lw.terms.WrenchSchedule(times=times, force=np.zeros((count + 1, 3)))
    vary = {f"wrench_schedule.force[{i},0]": lw.distributions.Normal(std=FORCE) for i in range(1, count + 1)}
    between, left = T1 / count, T1 - times[1:]
    ways = (_of_ramp(left + between) - 2.0 * _of_ramp(left) + _of_ramp(left - between)) / between
    spread = FORCE * float(np.linalg.norm(ways))
    return Event(lw.Ensemble(_scene(gusts), vary=vary), lambda x: x[:, 0] / spread + ndtri(p))


def _of_ramp(remaining: np.ndarray) -> np.ndarray:
    """Displacement by a force that grows by 1 N/s for the remaining time."""
    t = np.maximum(0.0, remaining)
    return np.asarray((0.5 * t**2 - TAU * t - TAU**2 * np.expm1(-t / TAU)) / DRAG)


EVENTS: dict[str, Callable[[float], Event]] = {
    "one side": one_side,
    "two sides": two_sides,
    "unequal sides": unequal_sides,
    "leaving a ball": leaving_a_ball,
    "20 inputs": of_20_inputs,
    "60 gusts": of_60_gusts,
    "white noise on linear drag": of_white_noise,
}


def autopilot() -> lw.Ensemble:
    """REMUS 100 on the way to 10 m, without noise and fault; nine numbers vary."""
    scene = lw.Scene.load(ROOT / "examples" / "scenes" / "remus_100_autopilot.toml")
    sensors = [dataclasses.replace(sensor, noise=0.0, drift=0.0) for sensor in scene.controller.sensors]
    controller = dataclasses.replace(scene.controller, faults=(), sensors=sensors)
    normal = lw.distributions.Normal
    vary = {
        "vehicle.buoyancy": lw.distributions.Uniform(low=297.0, high=302.0),
        "heading_pid.kp": normal(mean=1.0, std=0.1),
        "depth_pid.kp": normal(mean=0.1, std=0.005),
        "depth_pid.ki": normal(mean=0.001, std=0.0001),
        "depth_cell.bias": normal(std=0.05),
        "start.velocity[0]": normal(mean=1.54, std=0.05),
        "start.position[2]": normal(std=0.1),
        "depth_pid.kp_pitch": normal(mean=5.0, std=0.25),
        "depth_pid.kd_pitch": normal(mean=2.0, std=0.1),
    }
    return lw.Ensemble(dataclasses.replace(scene, controller=controller), vary=vary)
