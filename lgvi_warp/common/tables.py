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
    """Write records to a CSV file; it is there whole or not at all.

    Args:
        rows: Records, with one column for every key that some record has.
        path: The file.
        root: As of `files.placed`.

    Returns:
        Its path.

    Raises:
        SceneError: What is there is no plain file, or lies outside the folder.
        OSError: The file cannot be written.
    """
    names = list(dict.fromkeys(key for row in rows for key in row))
    with durable.placed(path, root) as beside, beside.open("x", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)
    return Path(path)
