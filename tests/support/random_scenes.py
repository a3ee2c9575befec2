# SPDX-License-Identifier: Apache-2.0
"""Scenes drawn at random: vehicles, starts, forces, lengths of run and errors to keep."""

import numpy as np

import lgvi_warp as lw
from lgvi_warp.accuracy import suggest as suggestion
from lgvi_warp.measuring.comparison import Sample
from lgvi_warp.measuring.cost import costs
from lgvi_warp.measuring.reference import make_reference
from lgvi_warp.measuring.trials import PRECISIONS, tried


def random_scene(seed):
    """An ensemble and what to ask of it: (ensemble, {error, of, t1})."""
    rng = np.random.default_rng([20, seed])
    mass = 10.0 ** rng.uniform(0.5, 3.0)
    size = (mass / 1000.0) ** (1.0 / 3.0)
    slender = np.exp(rng.uniform(-0.7, 0.7, 3))
    inertia = mass * size**2 * (slender.sum() - slender) / 3.0
    buoyancy = mass * 9.81 * (1.0 + rng.normal(scale=0.01))
    added_mass = mass * rng.uniform(0.1, 1.0, 3)
    center = [0.0, 0.0, -size * rng.uniform(0.0, 0.1)]
    vehicle = lw.Vehicle(mass, inertia=inertia, added_mass=added_mass, buoyancy=buoyancy, center_of_buoyancy=center)
    terms = []
    if rng.random() < 0.3:
        terms.append(lw.terms.Current(velocity=rng.normal(scale=0.3, size=3)))
    if rng.random() < 0.3:
        scale = np.repeat([mass, mass * size**2], 3)
        terms.append(lw.terms.Drag(linear=0.05 * scale * rng.random(6), quadratic=0.1 * scale * rng.random(6)))
    if rng.random() < 0.3:
        force, torque = rng.normal(scale=0.05 * mass, size=3), rng.normal(scale=0.02 * mass * size**2, size=3)
        terms.append(lw.terms.Wrench(force=force, torque=torque))
    spin = rng.normal(scale=10.0 ** rng.uniform(-1.0, 0.3), size=3)
    start = lw.Start([0.0, 0.0, 20.0], rotation_vector=rng.normal(size=3), velocity=rng.normal(scale=0.5, size=3),
                     angular_velocity=spin)  # fmt: skip
    scene = lw.Scene(vehicle, lw.Environment(gravity=9.81), terms, start)
    vary = {
        "start.angular_velocity": lw.distributions.Normal(std=0.05 * np.linalg.norm(spin)),
        "vehicle.mass": lw.distributions.Normal(relative=0.002),
    }
    of = ("position", "attitude")[int(rng.integers(2))]
    asked = {"error": 10.0 ** rng.uniform(-7.0, -1.5), "of": of, "t1": float(rng.integers(3, 40))}
    return lw.Ensemble(scene, 512, seed, vary), asked


METHODS = ("psi_x", "psi_s", "su4(psi_x)", "kl6(psi_x)", "kl8(psi_x)", "su4(psi_s)", "kl6(psi_s)", "kl8(psi_s)")


def judged(fleet, answer, requested, rounds=5):
    """Judgement of a suggestion: the largest error of all members over the asked one, and its cost over the best of all
    settings.

    The best is searched for in steps 1.2 times apart, for every method of the paper's family in both precisions.
    """
    sample = Sample(fleet, requested["t1"], fleet.members, suggestion.TIMES)
    reference = make_reference(sample, requested["of"], requested["error"] / 100.0)
    own = tried(sample, answer.setting, reference)
    good = [own]
    for method in METHODS:
        for dtype in PRECISIONS:
            m, last = sample.coarsest(3.0), None
            while sample.h(m) > 0.5 * answer.setting.h * len(lw.Method(method).stages) / len(own.plan.method.stages):
                one = tried(sample, sample.candidate(method, m, dtype), reference)
                if one.error(requested["of"]) <= requested["error"]:
                    last = one
                    break
                m = max(m + 1, round(1.2 * m))
            if last:
                good.append(last)
    prices = [price.us_per_vehicle_second for price in costs([one.plan for one in good], rounds)]
    best = min(range(len(good)), key=prices.__getitem__)
    return own.error(requested["of"]) / requested["error"], prices[0] / prices[best], good[best].candidate
