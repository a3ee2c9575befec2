# SPDX-License-Identifier: Apache-2.0
"""The account of the energy that a vehicle uses, and what all but its actuators take."""

from typing import Any

import warp as wp

from lgvi_kernels.law import *

ACCOUNT = True


# The hotel load [W]; where the energy used lies in the memory.
params = make_params("EnergyUse", lanes="hotel", words="memory")


@wp.func
def power(watts: Any, view: Any, p: Any):
    """The hotel load."""
    return watts + p.hotel
