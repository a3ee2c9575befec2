# SPDX-License-Identifier: Apache-2.0
"""Linear waves in deep water."""

import math

import numpy as np

from lgvi_warp.reference.terms import STILL, Flow, Law, View


class Waves(Law):
    """Numbers as those of `lw.terms.Waves`; gravity [m/s2]."""

    def flow(self, view: View) -> Flow:
        """The sum of the components (Faltinsen 1990, table 2.1)."""
        components = zip(self.amplitudes, self.periods, self.headings_deg, self.phases, strict=True)
        return sum((self.component(view, *numbers) for numbers in components), STILL)

    def component(self, view: View, a: float, period: float, heading_deg: float, phase: float) -> Flow:
        """One wave: u = Re (heading, -i down)^T a omega e^(-k depth) e^(-i theta), and its derivatives.

        docs/theory/water.md, (W7).
        """
        omega, heading = 2.0 * math.pi / period, math.radians(heading_deg)
        k = omega**2 / self.gravity
        along = np.array([math.cos(heading), math.sin(heading), 0.0])
        depth = view.b[2]
        theta = k * along @ view.b - omega * view.t + phase
        wave = (
            (along - 1j * np.array([0.0, 0.0, 1.0])) * a * omega * math.exp(-k * max(depth, 0.0)) * np.exp(-1j * theta)
        )
        by_place = -1j * k * along + np.array([0.0, 0.0, -k if depth > 0.0 else 0.0])
        return Flow(wave.real, (1j * omega * wave).real, np.outer(wave, by_place).real)

    def elevation(self, view: View) -> float:
        """Height of the surface above still water at view.b [m]."""
        total = 0.0
        for a, period, heading_deg, phase in zip(
            self.amplitudes, self.periods, self.headings_deg, self.phases, strict=True
        ):
            omega, heading = 2.0 * math.pi / period, math.radians(heading_deg)
            along = math.cos(heading) * view.b[0] + math.sin(heading) * view.b[1]
            total += a * math.cos(omega**2 / self.gravity * along - omega * view.t + phase)
        return float(total)
