# SPDX-License-Identifier: Apache-2.0
"""The energy used reaches the capacity of a battery."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

# Capacity [J]; where the energy used lies in the memory.
params = make_params("Battery", lanes="capacity", words="account_row")


@wp.func
def distance(view: Any, p: Any):
    """Energy left [J]: near the end, all digits of the sum and of its low part."""
    return (p.capacity - remembered(view, p.account_row)) - remembered(view, p.account_row + 1)
