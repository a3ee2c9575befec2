# SPDX-License-Identifier: Apache-2.0
"""A demand that a function of the host writes into the memory, once a tick."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

# First of six rows of the memory, X Y Z K M N.
params = make_params("Callback", words="answer")


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """The demand plus what the host wrote."""
    at = p.answer
    w.force = w.force + vec3(remembered(y, at), remembered(y, at + 1), remembered(y, at + 2))
    w.torque = w.torque + vec3(remembered(y, at + 3), remembered(y, at + 4), remembered(y, at + 5))
    return w
