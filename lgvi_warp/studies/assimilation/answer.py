# SPDX-License-Identifier: Apache-2.0
"""The answer of an assimilation: where the members are, how sure they are, and what they learned."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common import summaries
from lgvi_warp.common.summaries import Summarized
from lgvi_warp.sampling.designs.table import Table
from lgvi_warp.sampling.final import Final


@dataclass(frozen=True, eq=False, repr=False)
class Assimilated(Summarized):
    """Members that followed what was measured, after each measurement.

    Attributes:
        time: Times of the measurements (k,) [s].
        mean: Means after them, weighted with particles: position (k, 3) [m], velocity and angular_velocity (k, 3) [m/s, rad/s,
            body axes], attitude (k, 3, 3), and the learned numbers by name, (k, ...).
        std: Standard deviations of the same; of the attitude (k, 3) [rad], about the body's axes.
        innovations: By name of the series, values less predictions (k, m); NaN where it has none.
        innovation_std: What they should be, (k, m): root of the spread of the predictions and the instrument's variance.
        effective: Effective number of members before resampling, (k,); with Kalman filters their number.
        final: Where the members are at the end, from which a run can go on.
        parameters: The learned numbers of the members at the end, by name, (n, ...), as
            `run.states(final, parameters=parameters)` takes them.
        weights: Weights of the members at the end, (n,), with the sum 1.
        method: Name of the filter.
        messages: What the user should know.
        provenance: Scene, ensemble, settings, versions and machine.
    """

    time: np.ndarray
    mean: Mapping[str, np.ndarray]
    std: Mapping[str, np.ndarray]
    innovations: Mapping[str, np.ndarray]
    innovation_std: Mapping[str, np.ndarray]
    effective: np.ndarray
    final: Final
    parameters: Mapping[str, np.ndarray]
    weights: np.ndarray
    method: str
    messages: tuple[str, ...]
    provenance: dict[str, Any]

    def summary_rows(self) -> tuple[str, summaries.Rows]:
        """What was learned, and whether innovations are what they should be."""
        rows = [("method", self.method)]
        for name in self.parameters:
            rows.append((name, f"{_text(self.mean[name][-1])} +- {_text(self.std[name][-1])}"))
        rows.append(("position", f"{_text(self.mean['position'][-1])} +- {_text(self.std['position'][-1])} m"))
        for name, ratio in self.consistency().items():
            rows.append((f"innovations of {name}", f"{ratio:.2f} of what their spread should be"))
        rows.append(("effective", f"{self.effective[-1]:,.0f} of {self.final.members:,} members at the end"))
        rows += [("message", text) for text in self.messages]
        return f"Assimilation of {len(self.time):,} times to {self.time[-1]:g} s", rows

    def consistency(self) -> dict[str, float]:
        """Compare innovations with their spread.

        Returns:
            By name of the series, the root mean square of innovations over the deviation that they should have: near 1 where
            members and instruments are as sure as they should be, above 1 where they are too sure.
        """
        return {
            name: float(np.sqrt(np.nanmean((apart / self.innovation_std[name]) ** 2)))
            for name, apart in self.innovations.items()
        }

    def table(self) -> Table:
        """The learned numbers of the members as a design, whose runs begin with them.

        Returns:
            A table with a column for each number.
        """
        return Table(values=dict(self.parameters))


def _text(values: Any) -> str:
    """A few numbers, to four digits."""
    return ", ".join(f"{value:.4g}" for value in np.atleast_1d(values).ravel())
