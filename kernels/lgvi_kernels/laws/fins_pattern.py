# SPDX-License-Identifier: Apache-2.0
"""Fixed fins (fins) in the user's axes, where chords and normals along the axes have twists of few numbers."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws import fins
from lgvi_kernels.laws.fins import ROWS, lift_and_drag
from lgvi_kernels.laws.patterns import make_along, make_twist


@functools.cache
def made(words):
    """The law with these entries of some fin's twists: "c0", the first number of that of its chord; "n0", of its normal."""
    chord, normal = (frozenset(int(word[1]) for word in words if word[0] == kind) for kind in "cn")
    along_chord, along_normal = make_along(chord), make_along(normal)
    add_chord, add_normal = make_twist(chord), make_twist(normal)

    @wp.func
    def pattern_push(w: Any, view: Any, p: Any):
        """w and the wrench of each fin."""
        for i in range(p.count):
            at = p.first + wp.static(ROWS) * i
            along = along_chord(view, at)
            across = along_normal(view, at + 6)
            lift, drag = lift_and_drag(view, at, along, across)
            w = add_chord(w, view, at, lift * across - drag * along)
            w = add_normal(w, view, at + 6, -(lift * along) - drag * across)
        return w

    return device(__name__, words, params=fins.params, damping=fins.damping, push=pattern_push)
