# SPDX-License-Identifier: Apache-2.0
"""The canonical two-form of a rigid body's states, and moves between these: for tests of what maps keep."""

import numpy as np

from lgvi_warp.reference import rotation
from lgvi_warp.reference.submaps import State


def change(values):
    values = np.array(values)
    return np.abs(values - values[0]).max()


def two_form(x):
    """S of the canonical form at p, pi, left-trivialised: <dm1, u2> - <dm2, u1> - <m, [u1, u2]>, u = (v, w), m = (p, pi).

    [u1, u2] = (w1 x v2 - w2 x v1, w1 x w2) in se(3); rows and columns are (v, w, dp, dpi).
    """
    S = np.zeros((12, 12))
    S[6:, :6], S[:6, 6:] = np.eye(6), -np.eye(6)
    S[3:6, :3] = S[:3, 3:6] = rotation.hat(x.p)
    S[3:6, 3:6] = rotation.hat(x.pi)
    return S


def moved(x, d):
    """The state moved by d (12,): R^T db, the rotation vector of R^T R', dp, dpi."""
    return State(x.b + x.R @ d[:3], x.R @ rotation.exp(d[3:6]), x.p + d[6:9], x.pi + d[9:])


def coordinates(x, centre):
    """The move from centre to x, to second order: enough for a derivative at the centre."""
    relative = centre.R.T @ x.R
    w = rotation.vee(relative - relative.T) / 2
    return np.concatenate([centre.R.T @ (x.b - centre.b), w, x.p - centre.p, x.pi - centre.pi])
