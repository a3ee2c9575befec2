# SPDX-License-Identifier: Apache-2.0
"""Ballast that is held, in water of a density by depth: from U = -(sum of net forces times the columns above them)."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *
from lgvi_warp.extensions.gliders.device.density import column, relative_density

POTENTIAL = True
# Rows of each volume: its force downward in water of density rho0 [N], and its point [m].
ROWS = 4

params = make_params("BallastInProfile", words="first count density density_knots")


@wp.func
def law(w: Any, view: Any, p: Any):
    """f = net rho(d) / rho0 R^T e3 at each point, d its depth."""
    for i in range(p.count):
        point = row3(view, p.first + wp.static(ROWS) * i + 1)
        depth = view.b.z + dot(view.down, point)
        share = relative_density(view, p.first + p.density, p.density_knots, depth)
        f = (row1(view, p.first + wp.static(ROWS) * i) * share) * view.down
        w.force = w.force + f
        w.torque = w.torque + cross(point, f)
    return w


@wp.func
def energy(u: Any, view: Any, p: Any):
    """U."""
    for i in range(p.count):
        depth = view.b.z + dot(view.down, row3(view, p.first + wp.static(ROWS) * i + 1))
        above = column(view, p.first + p.density, p.density_knots, depth)
        u = u - row1(view, p.first + wp.static(ROWS) * i) * above
    return u
