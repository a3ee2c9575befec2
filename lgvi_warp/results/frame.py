# SPDX-License-Identifier: Apache-2.0
"""A run as a pandas table with a row for each member."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.errors import MissingExtra
from lgvi_warp.common.status import Status
from lgvi_warp.physics.fields import FIELDS, TABLE
from lgvi_warp.results.varied import varied
from lgvi_warp.statistics.values.quantity import KNOWN

if TYPE_CHECKING:
    import pandas


def frame_of(result: Any) -> pandas.DataFrame:
    """Build the table of a result (see `Result.frame`)."""
    try:
        import pandas
    except ImportError as error:
        raise MissingExtra("tables of members", "pandas", "store") from error
    columns: dict[str, Any] = dict(varied(result))
    codes, places = np.unique(np.asarray(result.status), return_inverse=True)
    columns["outcome"] = pandas.Categorical.from_codes(places, [Status(int(code)).name.lower() for code in codes])
    columns["end_time"] = result.end_time
    units = {"end_time": "s"}
    for name, values in _ends(result).items():
        for i, label in enumerate(TABLE[name].labels):
            columns[label], units[label] = values[:, i], TABLE[name].unit
    frame = pandas.DataFrame(columns, index=pandas.RangeIndex(result.members, name="member"))
    frame.attrs["units"] = units
    return frame


def _ends(result: Any) -> dict[str, np.ndarray]:
    """States (n, 3) at the end, by field, for the fields that were kept."""
    if result.end is not None:
        states = dict(result.final.states)
    else:
        k, stored = len(result.time), getattr(result.samples, "rows", None)
        places, fields = slice(0, result.members), [name for name in FIELDS if name in result.samples]
        states = {
            name: stored(name, slice(k - 1, k), places)[0] if stored else result.samples[name][-1] for name in fields
        }
    if "attitude" in states:
        turned: Any = {"attitude": states["attitude"][None]}
        states["euler"] = np.asarray(KNOWN["euler"].function(turned, None))[0]  # type: ignore[arg-type]
    return {name: states[name] for name in ENDS if name in states}


ENDS = ("position", "euler", "velocity", "angular_velocity")
