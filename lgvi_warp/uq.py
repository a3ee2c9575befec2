# SPDX-License-Identifier: Apache-2.0
"""Sensitivity of a quantity of interest to the varied parameters: Sobol indices, Morris screening, and adaptors.

    indices = lw.uq.sobol(scene, "position[2]", samples=1024, h=0.01, t1=60.0)
    print(indices)

SALib provides the design and estimates of Morris screening (extra: uq). The designs and estimates of Sobol indices are part
of lgvi_warp.
"""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
