# SPDX-License-Identifier: Apache-2.0
"""lgvi_warp: simulation of many underwater vehicles by a Lie group variational integrator, in Warp kernels on CPU cores."""

from lgvi_warp.common.doors import names_in_stub as _names_in_stub

__version__ = "0.2.0"

__all__, __getattr__, _ = _names_in_stub(__name__)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
