# SPDX-License-Identifier: Apache-2.0
"""Which of the varied parameters make a quantity of interest vary: Sobol indices, Morris' screening, and adaptors.

    indices = lw.uq.sobol(scene, "position[2]", samples=1024, h=0.01, t1=60.0)
    print(indices)

The designs and the estimates are SALib's (extra: uq).
"""

from __future__ import annotations

from typing import Any

from lgvi_warp.studies.sensitivity.adaptor import ScalarModel, model
from lgvi_warp.studies.sensitivity.analyses import morris, morris_of, sobol, sobol_of
from lgvi_warp.studies.sensitivity.indices import Indices, MorrisEffects, SobolIndices
from lgvi_warp.studies.sensitivity.outputs import FailedMembers, Outputs, evaluate

__all__ = [
    "FailedMembers",
    "Indices",
    "MorrisEffects",
    "Outputs",
    "ScalarModel",
    "SobolIndices",
    "evaluate",
    "model",
    "morris",
    "morris_of",
    "sobol",
    "sobol_of",
]


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    if name == "Model":
        import warnings

        warnings.warn("lw.uq.Model is now lw.uq.ScalarModel; write that", DeprecationWarning, stacklevel=2)
        return ScalarModel
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
