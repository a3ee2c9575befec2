# SPDX-License-Identifier: Apache-2.0
"""Common parts of the picture and the recording of a fleet: styles of outcomes, the title, curves of members under way."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lgvi_warp.common.status import Status, stop_time
from lgvi_warp.physics import energy as invariants
from lgvi_warp.views.choice import of_members, pieces

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result


class OutcomeStyle(NamedTuple):
    """Style of members with one outcome."""

    color: str
    marker: str

    @property
    def rgb(self) -> tuple[int, int, int]:
        """The colour as (red, green, blue), 0 to 255 each."""
        red, green, blue = bytes.fromhex(self.color[1:])
        return red, green, blue


# Colours after Okabe & Ito, distinct for every kind of colour vision. All failures share one, with a marker each.
OUTCOME_STYLES = {
    Status.OK: OutcomeStyle("#3C82DC", ""),
    Status.SURFACE: OutcomeStyle("#009E73", "^"),
    Status.FLOOR: OutcomeStyle("#E69F00", "v"),
    Status.BOX: OutcomeStyle("#CC79A7", "s"),
    Status.TIME: OutcomeStyle("#8C8C8C", "o"),
    Status.CONDITION: OutcomeStyle("#C9B400", "D"),
    Status.BATTERY: OutcomeStyle("#6A3D9A", "p"),
    Status.OUTSIDE: OutcomeStyle("#56B4E9", "h"),
    Status.MISSION_DONE: OutcomeStyle("#117733", "*"),
    Status.POSITION_UNCERTAIN: OutcomeStyle("#882255", "<"),
}
FAILURES = [code for code in Status if code not in OUTCOME_STYLES]
OUTCOME_STYLES |= {code: OutcomeStyle("#D55E00", marker) for code, marker in zip(FAILURES, "xX*P1+23", strict=True)}


class Curve(NamedTuple):
    """One number of all members against time, shape (k, n)."""

    name: str
    label: str
    values: np.ndarray


def energy_curve(result: Result) -> Curve:
    """Energy against time [J], or its error E(t) - E(0) if the terms of the scene conserve energy."""
    if "energy" in invariants.conserved(result):
        return Curve("Energy error", "E(t) - E(0) [J]", result.energy - result.energy[:1])
    return Curve("Energy", "E(t) [J]", result.energy)


def title(result: Result) -> str:
    """Title of a picture: members, method and step, and the outcomes unless all ran to the end."""
    method, step = result.provenance["method"]["name"], result.provenance["step"]
    text = f"{of_members(result.members, members_of_run(result))}, {method}, step {step:g} s"
    counts = result.status.counts()
    if set(counts) == {"ok"}:
        return text
    return f"{text}: " + ", ".join(f"{number:,} {name}" for name, number in counts.items())


def members_of_run(result: Result) -> int:
    """Count the members of the run from which a result, or part of one, comes."""
    planned = result.provenance["ensemble"].get("members") or 0
    return max(result.members, int(result.provenance.get("members", planned)))


def identity(result: Result) -> str:
    """Identifier of a run: a hash of its provenance, which parts of a run have in common, and of samples."""
    digest = hashlib.sha256(json.dumps(result.provenance, sort_keys=True).encode())
    arrays = [result.time, np.asarray(result.status), stop_time(result)]
    for array in (*arrays, *(samples["position"][[0, -1]] for _, samples in pieces(result, ("position",)))):
        digest.update(f"{array.shape} {array.dtype.str}\n".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()[:16]
