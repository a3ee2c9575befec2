# SPDX-License-Identifier: Apache-2.0
"""Allocation by a matrix: each command is a sum of the demand's components."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels import device
from lgvi_kernels.law import *
from lgvi_kernels.laws.control.lost import since
from lgvi_kernels.laws.control.rest import ROWS as rest_rows
from lgvi_kernels.laws.control.rest import rest

# Rows of rest.py, then of one command: what of X Y Z and of K M N it takes (6), what a unit of it delivers (6), limit, and the
# time from which it is known to be lost.
ROWS = 14
REST = rest_rows


# First row of the table; first row of the commands; count.
params = make_params("Matrix", words="first commands count")


@functools.cache
def made(features):
    """The allocation; of the features "all" and "lost" the latter says that channels may be known to be lost."""
    loses = "lost" in features

    @wp.func
    def allocate_by_matrix(w: Any, y: Any, p: Any):
        """u = A w within the limits; undelivered are (I - A^+ A) w and A^+ of what the limits and losses cut off."""
        undelivered = rest(w, y, p.first)
        for i in range(p.count):
            at = p.first + wp.static(REST) + wp.static(ROWS) * i
            most = row1(y, at + 12)
            wanted = dot(row3(y, at), w.force) + dot(row3(y, at + 3), w.torque)
            u = clamp(wanted, -most, most)
            if wp.static(loses):
                u = positive(since(y, row1(y, at + 13)), u - u, u)
            remember(y, p.commands + i, u)
            undelivered.force = undelivered.force + (wanted - u) * row3(y, at + 6)
            undelivered.torque = undelivered.torque + (wanted - u) * row3(y, at + 9)
        return undelivered

    return device(__name__, features, params=params, allocate=allocate_by_matrix)
