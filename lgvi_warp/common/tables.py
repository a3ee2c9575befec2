# SPDX-License-Identifier: Apache-2.0
"""Write records as tables for other programs."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lgvi_warp.common import files as durable


def write_csv(
    rows: Sequence[Mapping[str, Any]], path: str | os.PathLike[str], root: str | os.PathLike[str] | None = None
) -> Path:
    """Write records to a CSV file; it is there whole or not at all."""
    names = list(dict.fromkeys(key for row in rows for key in row))
    with durable.placed(path, root) as beside, beside.open("x", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)
    return Path(path)
