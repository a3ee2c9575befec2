# SPDX-License-Identifier: Apache-2.0
"""Tether: a spring from an anchor to a point of the vehicle, without force below its rest length."""

import numpy as np

from lgvi_warp.reference.rotation import Array, cross, norm
from lgvi_warp.reference.terms import Law, View


class Tether(Law):
    """Attributes as in `lw.terms.Tether`."""

    rest_length = 0.0
    potential_force = True

    def span(self, view: View) -> Array:
        """Vector from the attachment to the anchor, inertial axes."""
        return np.asarray(self.anchor - view.b - view.R @ self.attachment)

    def wrench(self, view: View) -> tuple[Array, Array]:
        """Tension k max(|d| - L0, 0) along d, at the attachment."""
        d = self.span(view)
        length = norm(d)
        if length <= self.rest_length or length == 0.0:
            return np.zeros(3), np.zeros(3)
        f = view.R.T @ (self.stiffness * (1.0 - self.rest_length / length) * d)
        return f, cross(self.attachment, f)

    def potential(self, view: View) -> float:
        """U = k max(|d| - L0, 0)^2 / 2 [J]."""
        return 0.5 * self.stiffness * max(norm(self.span(view)) - self.rest_length, 0.0) ** 2
