# SPDX-License-Identifier: Apache-2.0
"""Buoyancy of a hull in water of a density by depth, B rho(d) / rho0: here its deviation from B, which weight.py has."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_warp.extensions.gliders.device.density import column, relative_density

# Params: B [N], centre of buoyancy [m], rows of the table.
params = make_params("DensityProfile", lanes="buoyancy", vectors="center", words="first density_knots")
yielding = make_params(
    "DensityProfileYielding", lanes="buoyancy compressibility reference", vectors="center", words="first density_knots"
)


def make_law(compressed):
    """The law of a stiff hull, or of one that yields."""

    @wp.func
    def law(w: Any, view: Any, p: Any):
        """f = -B (rho(d) / rho0 (1 - compressibility (d - d0)) - 1) R^T e3 at the centre of buoyancy, d its depth."""
        depth = view.b.z + dot(view.down, p.center)
        share = relative_density(view, p.first, p.density_knots, depth)
        if wp.static(compressed):
            share = share - share * (p.compressibility * (depth - p.reference))
        f = -(p.buoyancy * (share - ones(depth))) * view.down
        w.force = w.force + f
        w.torque = w.torque + cross(p.center, f)
        return w

    return law


@wp.func
def energy(u: Any, view: Any, p: Any):
    """U = B (integral of rho / rho0 - d)."""
    depth = view.b.z + dot(view.down, p.center)
    return u + p.buoyancy * (column(view, p.first, p.density_knots, depth) - depth)


@functools.cache
def made(features):
    """The law of a stiff hull, which has a potential; "compressed": of one that yields."""
    if "compressed" in features:
        return device(__name__, features, params=yielding, law=make_law(True))
    return device(__name__, features, params=params, law=make_law(False), POTENTIAL=True, energy=energy)
