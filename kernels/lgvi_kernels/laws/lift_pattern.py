# SPDX-License-Identifier: Apache-2.0
"""Lift of a hull (lift) in the user's axes, where the speed ahead is nu.x, and most entries of the matrix are zero."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws import lift
from lgvi_kernels.laws.patterns import entries_of, make_less


@functools.cache
def made(words):
    """The law with these entries of its matrix: "m01", row 0 and column 1."""
    less = make_less(entries_of(words, "m"))

    @wp.func
    def pattern_push(w: Any, view: Any, p: Any):
        """w - u matrix (nu; Om)."""
        u = view.nu.x
        return less(w, view, p.first + 6, u * view.nu, u * view.Om)

    return device(__name__, words, params=lift.params, damping=lift.damping, push=pattern_push)
