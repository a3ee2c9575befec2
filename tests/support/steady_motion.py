# SPDX-License-Identifier: Apache-2.0
"""Equations of motion of a vehicle's tables, written here once more in NumPy: what the kernels are checked against.

A state is nu, Om (6,) [m/s, rad/s] in body axes and the inertial down in body axes (3,). Commands are held.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root


class Body:
    """A vehicle and its terms, from the tables of its file.

    Args:
        tables: The file's content.
        commands: What replaces keys of terms, by the term's type: {"thrusters": {"command": [...]}}.
        neutral: Whether buoyancy is set to the weight.
    """

    def __init__(self, tables, commands=(), neutral=False):
        vehicle, water = tables["vehicle"], tables["environment"]
        self.rigid = np.array(vehicle["rigid_body_mass_matrix"])
        self.mass_matrix = self.rigid + np.array(vehicle["added_mass_matrix"])
        self.weight = vehicle["weight"]
        self.buoyancy = self.weight if neutral else vehicle["buoyancy"]
        self.gravity_at, self.buoyancy_at = (np.array(vehicle[f"center_of_{of}"]) for of in ("gravity", "buoyancy"))
        self.density = water["water_density"]
        self.terms = [term | dict(commands).get(term["type"], {}) for term in tables["terms"]]

    def forces(self, v, down):
        """(6,) [N, N m] of weight, buoyancy and all terms."""
        total = np.zeros(6)
        for size, at in ((self.weight, self.gravity_at), (-self.buoyancy, self.buoyancy_at)):
            total += push(at, size * np.asarray(down))
        for term in self.terms:
            total += LAWS[term["type"]](term, v, self.density)
        return total

    def acceleration(self, v, down):
        """(6,): Kirchhoff's equations, P' = F - Om x P, L' = T - Om x L - nu x P."""
        P, L = np.split(self.mass_matrix @ v, 2)
        nu, Om = v[:3], v[3:]
        turning = np.concatenate([np.cross(Om, P), np.cross(Om, L) + np.cross(nu, P)])
        return np.linalg.solve(self.mass_matrix, self.forces(v, down) - turning)

    def steady(self, guess):
        """A steady turn about the vertical: nu (3,), roll and pitch [rad], rate [rad/s].

        In it nu is constant in body axes, and so is Om = rate times down: six equations for six unknowns.
        """

        def off(x):
            down = down_of(x[3], x[4])
            return self.acceleration(np.concatenate([x[:3], x[5] * down]), down)

        found = root(off, guess, tol=1e-13)
        assert np.abs(off(found.x)).max() < 1e-9, found.message
        return found.x

    def run(self, times, roll=0.0, pitch=0.0, nu=(0.0, 0.0, 0.0), rtol=1e-9):
        """Velocities (n, 6) and downs (n, 3) at times (n,), released level but for roll and pitch [rad]."""

        def rate(_, state):
            v, down = state[:6], state[6:]
            return np.concatenate([self.acceleration(v, down), np.cross(down, v[3:])])

        start = np.concatenate([nu, np.zeros(3), down_of(roll, pitch)])
        found = solve_ivp(rate, (0.0, times[-1]), start, "DOP853", times, rtol=rtol, atol=0.1 * rtol)
        return found.y[:6].T, found.y[6:].T


def down_of(roll, pitch):
    """The inertial down (3,) in body axes."""
    return np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])


def push(at, force):
    """(6,) of a force at a point."""
    return np.concatenate([force, np.cross(at, force)])


def drag(term, v, _):
    linear, quadratic = np.array(term["linear"]), np.array(term["quadratic"])
    if linear.ndim == 1:
        return -(linear + quadratic * np.abs(v)) * v
    return -linear @ v - quadratic @ (np.abs(v) * v)


def lift_of_the_hull(term, v, _):
    return -v[0] * np.array(term["matrix"]) @ v


def products(term, v, _):
    total, places = np.zeros(6), dict(zip("uvwpqr", v, strict=True))
    for name, value in zip(term["products"], term["values"], strict=True):
        # Each letter is a velocity; one between bars counts by its size.
        product, text = value, name[2:]
        while text:
            sized = text[0] == "|"
            letter = text[1] if sized else text[0]
            product *= abs(places[letter]) if sized else places[letter]
            text = text[3:] if sized else text[1:]
        total["XYZKMN".index(name[0])] += product
    return total


def fins(term, v, density):
    total, none = np.zeros(6), np.zeros(len(term["area"]))
    rows = (term[key] for key in ("position", "chord", "normal", "area", "lift_slope", "drag"))
    for at, chord, normal, area, slope, drag_0, drag_n, turn in zip(
        *rows, term.get("drag_normal", none), term["command"], strict=True
    ):
        at, chord = np.array(at), np.array(chord) / np.linalg.norm(chord)
        normal = np.array(normal) - (normal @ chord) * chord
        normal /= np.linalg.norm(normal)
        velocity = v[:3] + np.cross(v[3:], at)
        half = 0.5 * density * area
        if not term.get("flow_angle", True):
            ahead = velocity @ chord
            force = half * (slope * turn * ahead**2 * normal - drag_0 * abs(ahead) * ahead * chord)
        else:
            along, across = velocity @ chord, velocity @ normal
            flow = np.arctan2(across, along)
            speed, a = np.hypot(along, across), turn - flow
            curve = np.sin(a) * np.cos(a)
            if "lift_angles" in term:
                curve = np.sign(a) * np.interp(abs(a), term["lift_angles"], term["lift_coefficients"])
            lift = half * slope * curve * speed**2
            back = half * (drag_0 + drag_n * np.sin(a) ** 2) * speed**2
            force = lift * (np.cos(flow) * normal - np.sin(flow) * chord)
            force -= back * (np.cos(flow) * chord + np.sin(flow) * normal)
        total += push(at, force)
    return total


def thrust(term, v, _):
    n = np.array(term["command"])
    size = np.array(term["coefficient"]) * n * np.abs(n)
    return sum(push(np.array(at), f * np.array(along)) for at, along, f in
               zip(term["position"], term["direction"], size, strict=True))  # fmt: skip


def wrench(term, v, _):
    return np.concatenate([term["force"], term["torque"]])


LAWS = {
    "drag": drag,
    "drag_matrix": drag,
    "body_lift": lift_of_the_hull,
    "quadratic_form": products,
    "control_fins": fins,
    "thrusters": thrust,
    "wrench": wrench,
}
