# SPDX-License-Identifier: Apache-2.0
"""Linear waves."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import STILL, Flow, Law, View
from lgvi_warp.reference.terms.current import Current


class Wave(NamedTuple):
    """One component: amplitude [m], wavenumber [1/m], frequency at a fixed place and in the water [rad/s], heading (3,)."""

    a: float
    k: float
    omega: float
    sigma: float
    along: Array
    phase: float


class Waves(Law):
    """Attributes as in `lw.terms.Waves`; gravity [m/s2]; current (3,) [m/s], the uniform one of the scene."""

    depth, periods_of = math.inf, "ground"
    current = np.zeros(3)

    def beside(self, laws: tuple[Law, ...]) -> Law:
        """The same law on the uniform currents among these laws."""
        current = sum((law.velocity for law in laws if isinstance(law, Current)), np.zeros(3))
        return type(self)(**vars(self) | {"current": current})

    def components(self) -> Iterator[Wave]:
        """The components whose waves can propagate on the current."""
        for a, period, heading_deg, phase in zip(
            self.amplitudes, self.periods, self.headings_deg, self.phases, strict=True
        ):
            heading, frequency = math.radians(heading_deg), 2.0 * math.pi / period
            along = np.array([math.cos(heading), math.sin(heading), 0.0])
            drift = float(along @ self.current)
            k = wavenumber(frequency, 0.0 if self.periods_of == "water" else drift, self.depth, self.gravity)
            if k is not None:
                shift = k * drift
                omega, sigma = (
                    (frequency + shift, frequency) if self.periods_of == "water" else (frequency, frequency - shift)
                )
                yield Wave(a, k, omega, sigma, along, phase)

    def flow(self, view: View) -> Flow:
        """The sum of the components (Faltinsen 1990, table 2.1)."""
        return sum((self.component(view, wave) for wave in self.components()), STILL)

    def component(self, view: View, wave: Wave) -> Flow:
        """One wave: u = Re (C heading, -i S down)^T a sigma e^(-i theta), and its derivatives; C, S from `profiles`.

        docs/theory/water.md, (W7).
        """
        k, depth = wave.k, view.b[2]
        C, S = profiles(k, depth, self.depth)
        size = wave.a * wave.sigma * np.exp(-1j * theta(wave, view))
        u = (C * wave.along - 1j * S * DOWN) * size
        inside = k if 0.0 < depth < self.depth else 0.0
        by_place = np.outer(u, -1j * k * wave.along) + np.outer(-inside * (S * wave.along - 1j * C * DOWN) * size, DOWN)
        return Flow(u.real, (1j * wave.omega * u).real, by_place.real)

    def elevation(self, view: View) -> float:
        """Height of the surface above still water at view.b [m]."""
        return sum((wave.a * math.cos(theta(wave, view)) for wave in self.components()), 0.0)

    def acceleration(self, view: View) -> Array:
        """First-order acceleration of the water at view.b, in its own frame [m/s2]."""
        total = np.zeros(3)
        for wave in self.components():
            C, S = profiles(wave.k, view.b[2], self.depth)
            angle = theta(wave, view)
            total = total + wave.a * wave.sigma**2 * (C * math.sin(angle) * wave.along + S * math.cos(angle) * DOWN)
        return total

    def head(self, view: View) -> float:
        """Wave pressure at view.b divided by rho g [m]: a cosh k(h - depth) / cosh k h."""
        total = 0.0
        for wave in self.components():
            held = 1.0 if math.isinf(self.depth) else math.tanh(wave.k * self.depth)
            total += wave.a * held * profiles(wave.k, view.b[2], self.depth)[0] * math.cos(theta(wave, view))
        return total


DOWN = np.array([0.0, 0.0, 1.0])


def theta(wave: Wave, view: View) -> float:
    """Phase of a component at a place and time."""
    return float(wave.k * wave.along @ view.b - wave.omega * view.t + wave.phase)


def profiles(k: float, depth: float, h: float) -> tuple[float, float]:
    """cosh k(h - depth) / sinh k h and sinh k(h - depth) / sinh k h, constant above the surface and below the floor."""
    z = min(max(depth, 0.0), h)
    if math.isinf(h):
        return math.exp(-k * z), math.exp(-k * z)
    return math.cosh(k * (h - z)) / math.sinh(k * h), math.sinh(k * (h - z)) / math.sinh(k * h)


def wavenumber(omega: float, drift: float, h: float, g: float) -> float | None:
    """The k with sqrt(g k tanh k h) + k U = omega, by bisection; None if there is none.

    The left side increases up to the k of waves that stand still against the current.
    """

    def beyond(k: float) -> float:
        return math.sqrt(g * k * math.tanh(min(k * h, 400.0))) + k * drift - omega

    def standing(k: float) -> float:
        step = 1e-6 * k
        return beyond(k - step) - beyond(k + step)

    high = 1e-9
    while beyond(high) < 0.0 and standing(high) < 0.0:
        high *= 2.0
    if drift < 0.0 and standing(high) > 0.0:
        high = halved(standing, 0.5 * high, high)
    return None if beyond(high) < 0.0 else halved(beyond, 0.0, high)


def halved(f, low: float, high: float) -> float:  # type: ignore[no-untyped-def]
    """Root, by bisection, of a function that is negative at low and positive at high."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if f(middle) > 0.0 else (middle, high)
    return 0.5 * (low + high)
