# SPDX-License-Identifier: Apache-2.0
"""Drag by 6x6 matrices (drag_matrix) in the user's axes, where most entries are zero."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws import drag_matrix
from lgvi_kernels.laws.patterns import entries_of, make_less, squares


@functools.cache
def made(words):
    """The law with these entries: "l01", row 0 and column 1 of the linear matrix; "q01", of the quadratic one."""
    linear, quadratic = entries_of(words, "l"), entries_of(words, "q")
    less_linear, less_quadratic = make_less(linear), make_less(quadratic)

    @wp.func
    def pattern_push(w: Any, view: Any, p: Any):
        """w - linear (nu; Om) - quadratic (nu |nu|; Om |Om|)."""
        if wp.static(bool(linear)):
            w = less_linear(w, view, p.first, view.nu, view.Om)
        if wp.static(bool(quadratic)):
            w = less_quadratic(w, view, p.first + 36, squares(view.nu), squares(view.Om))
        return w

    return device(__name__, words, params=drag_matrix.params, damping=drag_matrix.damping, push=pattern_push)
