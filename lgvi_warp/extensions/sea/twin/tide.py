# SPDX-License-Identifier: Apache-2.0
"""A tide, and laws that depend on the depth below its surface."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Flow, Law, View
from lgvi_warp.reference.terms.waves import Waves


class Tide(Law):
    """Numbers of `lw.terms.Tide`: amplitudes, periods and phases (k,); times and heights (m,); mean."""

    amplitudes: Any = ()
    periods: Any = ()
    phases: Any = ()
    times: Any = ()
    heights: Any = ()
    mean = 0.0

    def height(self, t: float) -> float:
        """Height of the surface above the depth 0 [m]."""
        total = float(self.mean)
        for a, period, phase in zip(self.amplitudes, self.periods, self.phases, strict=True):
            total += a * math.cos(2.0 * math.pi * t / period + phase)
        return total + (float(np.interp(t, self.times, self.heights)) if len(self.times) else 0.0)


class InTide(Law):
    """A law that depends on the depth below the tide's surface."""

    @property
    def inner(self) -> Any:
        """The law, which may be a twin with its own numbers."""
        return vars(self)["law"]

    def below(self, view: View) -> View:
        """The view with the depth below the tide's surface."""
        return replace(view, b=view.b + np.array([0.0, 0.0, self.tide.height(view.t)]))

    def wrench(self, view: View) -> tuple[Array, Array]:
        """Wrench of the law at its depth below the tide's surface."""
        return self.inner.wrench(self.below(view))

    def flow(self, view: View) -> Flow:
        """See `wrench`."""
        return self.inner.flow(self.below(view))

    def start(self) -> Array:
        """See `wrench`."""
        return self.inner.start()

    def evolve(self, view: View, second: bool) -> Array:
        """See `wrench`."""
        return self.inner.evolve(self.below(view), second)

    def follow(self, view: View) -> Array:
        """See `wrench`."""
        return self.inner.follow(self.below(view))

    def beside(self, laws: tuple[Law, ...]) -> Law:
        """The law beside other laws, whose waves are below the tide."""
        waves = tuple(law.inner if isinstance(law, InTide) and isinstance(law.inner, Waves) else law for law in laws)
        return InTide(law=self.inner.beside(waves), tide=self.tide)
