# SPDX-License-Identifier: Apache-2.0
"""Buoyancy that a hull loses where it is above the surface: parts along the hull, each a section of its height.

Of a part whose middle is at the depth d below the surface, c its vertical extent over its height, u = d / (c H / 2):

    f = B lost(u) R^T e3,    U = B (c (H / 2) moment(u) - d lost(u))

with lost(u) the share of the section above the water, and moment(u) that of the area below about the middle.
"""

import functools
import math
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.swell import swell, swell_finite

# Rows of a part: place along the hull [m], buoyancy [N], half of its height [m] and the inverse of it; of its extent,
# c^2 = 1 - a^2 (tilt - stretch a^2), tilt and stretch, a the sine of the hull's pitch.
ROWS = 6


@functools.cache
def params(width, real):
    """Params: axis, the unit vector along the hull; center of buoyancy [m]; count of parts, whose rows are the first."""
    Lane3 = lane3(width, real)
    return struct("SurfaceBuoyancy", axis=Lane3, center=Lane3, first=wp.int32, count=wp.int32, waves=wp.int32)


@wp.func
def box_lost(u: Any):
    """lost and moment of a section as broad above as below."""
    unity = ones(u)
    half = u.dtype(0.5)
    return half * (unity - u), (half * half) * (unity - u * u)


@wp.func
def circle_lost(u: Any):
    """Those of a circle: (arccos u - u w) / pi and 2 w^3 / (3 pi), w^2 = 1 - u^2."""
    ww = ones(u) - u * u
    w = root(ww)
    lost = u.dtype(wp.static(1.0 / math.pi)) * (arctangent2(w, u) - u * w)
    return lost, u.dtype(wp.static(2.0 / (3.0 * math.pi))) * (ww * w)


def make_law(lost_of, swell_of):
    """The law of a section, below waves (see lgvi_kernels/swell.py) or still water, None."""
    waves = swell_of is not None

    @wp.func
    def surface_law(w: Any, view: Any, p: Any):
        """f = B lost(u) (R^T e3 - Du/Dt / g) at each part, and the moment of sections that are below in part."""
        a = dot(p.axis, view.down)
        aa = a * a
        unity = ones(a)
        middle = view.b.z + dot(view.down, p.center)
        F = unity - unity
        M = F
        turn = F
        force = vec3(F, F, F)
        moment = force
        for i in range(p.count):
            at = p.first + wp.static(ROWS) * i
            x = row1(view, at)
            B = row1(view, at + 1)
            tilt = row1(view, at + 4)
            stretched = row1(view, at + 5) * aa
            inverse = unity / root(unity - aa * (tilt - stretched))
            depth = middle + x * a
            lean = force - force
            if wp.static(waves):
                b = view.b + to_inertial(view, p.center + x * p.axis)
                elevation, lean = swell_of(view, p.first + wp.static(ROWS) * p.count, p.waves, b)
                depth = depth + elevation
            u = clamp(depth * (inverse * row1(view, at + 3)), -unity, unity)
            lost, m = lost_of(u)
            f = B * lost
            turn = turn + (B * row1(view, at + 2)) * (m * inverse * (stretched + stretched - tilt))
            if wp.static(waves):
                pushed = f * (view.down - to_body(view, lean))
                force = force + pushed
                moment = moment + x * pushed
            else:
                F = F + f
                M = M + x * f
        if wp.static(not waves):
            force = F * view.down
            moment = M * view.down
        w.force = w.force + force
        w.torque = w.torque + cross(p.center, force) + cross(p.axis, moment - (a * turn) * view.down)
        return w

    return surface_law


def make_energy(lost_of):
    """The potential of a section at still water."""

    @wp.func
    def surface_energy(U: Any, view: Any, p: Any):
        """U = sum of B (c (H / 2) moment(u) - d lost(u)), 0 where all is below the surface and positive elsewhere."""
        a = dot(p.axis, view.down)
        aa = a * a
        unity = ones(a)
        middle = view.b.z + dot(view.down, p.center)
        for i in range(p.count):
            at = p.first + wp.static(ROWS) * i
            c = root(unity - aa * (row1(view, at + 4) - row1(view, at + 5) * aa))
            depth = middle + row1(view, at) * a
            u = clamp(depth * ((unity / c) * row1(view, at + 3)), -unity, unity)
            lost, m = lost_of(u)
            U = U + row1(view, at + 1) * (c * row1(view, at + 2) * m - depth * lost)
        return U

    return surface_energy


SWELL = {"waves": swell, "finite": swell_finite}
LOST = {"box": box_lost, "circle": circle_lost}


@functools.cache
def made(features):
    """The law of a section, "box" or "circle"; "waves" or "finite": below waves, where it has no potential."""
    lost_of, above = LOST[features[0]], SWELL.get(features[-1])
    if above is not None:
        return device(__name__, features, params=params, law=make_law(lost_of, above))
    energy = make_energy(lost_of)
    functions = {"law": make_law(lost_of, None), "energy": energy, "supply": energy}
    return device(__name__, features, params=params, POTENTIAL=True, **functions)
