# SPDX-License-Identifier: Apache-2.0
"""Operations of a step of the paper's example, by method, as `python -m benchmarks table roofline` counted them."""

import json

from benchmarks.tables.roofline import ROWS


def operations(method):
    """Read the operations of one step, a fused pair as two; None for a method that was not counted."""
    if method.adaptive or method.iterations is not None:
        return None
    counts = {row["method"]: row["operations"] for row in json.loads(ROWS.read_text()) if row["scene"] == "paper"}
    return counts.get(method.name)
