# SPDX-License-Identifier: Apache-2.0
"""Bodies whose statistics are known in closed form: a fall against linear drag, a drift, a white force."""

import dataclasses
import math

import numpy as np
from scipy import integrate, stats

import lgvi_warp as lw

MASS, ADDED, DRAG, GRAVITY = 100.0, 20.0, 12.0, 9.8
RELAXATION = (MASS + ADDED) / DRAG  # s
TIME = 20.0  # s
HEAVY = 24.0  # N, weight less buoyancy
STRENGTH = 6.0  # N s^1/2
METHOD = "rk4"


def sphere(*terms, **sections):
    """A body with the same mass along all axes and nothing that turns it, in linear drag."""
    vehicle = lw.Vehicle(
        mass=MASS,
        added_mass=[ADDED] * 3,
        inertia=[5.0, 6.0, 7.0],
        buoyancy=MASS * GRAVITY - HEAVY,
        center_of_buoyancy=[0.0] * 3,
    )
    drag = lw.terms.Drag(linear=[DRAG] * 3 + [1.0] * 3)
    environment = lw.Environment(gravity=GRAVITY)
    return lw.Scene(vehicle=vehicle, environment=environment, start=lw.Start(position=[0.0, 0.0, 400.0]),
                    terms=[drag, *terms], **sections)  # fmt: skip


def fall(drag=DRAG, force=HEAVY):
    """Way down of a body from rest [m]: m v' = F - d v."""
    t = (MASS + ADDED) / drag
    return force / drag * (TIME - t * (1.0 - np.exp(-TIME / t)))


def falling():
    """Uncertain buoyancy, and drag along z between 9 and 15 N s/m; the mean depth, and where it is above 450 m."""
    vary = {"vehicle.buoyancy": lw.distributions.Normal(std=4.0), "drag.linear[2]": lw.distributions.Uniform(9.0, 15.0)}
    return lw.Ensemble(sphere(), 64, vary=vary)


def mean_depth():
    """By quadrature over the drag: the fall is linear in the buoyancy."""
    return 400.0 + integrate.quad(lambda d: fall(d), 9.0, 15.0)[0] / 6.0


def probability_deeper(limit):
    """By quadrature over the drag: the fall is normal for each."""

    def given(drag):
        return stats.norm.sf(limit - 400.0, fall(drag), fall(drag, 4.0))

    return integrate.quad(given, 9.0, 15.0)[0] / 6.0


def pushed():
    """A body without weight in a white force, its current's north part uncertain."""
    scene = sphere(lw.terms.WrenchNoise(force=[STRENGTH] * 3), lw.terms.Current(velocity=[0.2, 0.0, 0.0]))
    scene = dataclasses.replace(scene, vehicle=dataclasses.replace(scene.vehicle, buoyancy=MASS * GRAVITY))
    return lw.Ensemble(scene, 64, vary={"current.velocity[0]": lw.distributions.Normal(std=0.05)})


def spread_north():
    """Standard deviation of the way north [m]: of the current, and of Langevin's equation."""
    t, decay = RELAXATION, math.exp(-TIME / RELAXATION)
    noise = (STRENGTH / DRAG) ** 2 * (TIME - 2.0 * t * (1.0 - decay) + 0.5 * t * (1.0 - decay**2))
    return math.hypot(math.sqrt(noise), 0.05 * (TIME - t * (1.0 - decay)))


def mean_north():
    """The way of a body from rest that the water takes along [m]."""
    return 0.2 * (TIME - RELAXATION * (1.0 - math.exp(-TIME / RELAXATION)))
