# SPDX-License-Identifier: Apache-2.0
"""Fixed fins (fins) in the user's axes, where chords and normals along the axes have twists of few numbers."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws import fins
from lgvi_kernels.laws.fins import ROWS, lift_and_drag, make_fin
from lgvi_kernels.laws.patterns import make_unrolled, patterns_of


def make_add(i, entries):
    """(w, view, p) -> w and the wrench of fin i."""
    flow, add_wrench = make_fin(*entries)

    @wp.func
    def add_fin(w: Any, view: Any, p: Any):
        at = p.first + wp.static(ROWS * i)
        along, across = flow(view, at)
        lift, drag = lift_and_drag(view, at, along, across)
        return add_wrench(w, view, at, lift * across - drag * along, -(lift * along) - drag * across)

    return add_fin


@functools.cache
def made(words):
    """The law with these entries of each fin's twists (see fins.make_fin)."""
    push = make_unrolled([make_add(i, entries) for i, entries in enumerate(patterns_of(words, "cn"))])
    return device(__name__, words, params=fins.params, damping=fins.damping, push=push)
