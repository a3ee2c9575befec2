# SPDX-License-Identifier: Apache-2.0
"""Rare failures of a sweep's cells: their probabilities, and ratios of the probabilities of two cases."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.files import place_of
from lgvi_warp.common.npy_files import of_npz, write_npz
from lgvi_warp.common.safe_files import parsed
from lgvi_warp.criteria.memory import key_of
from lgvi_warp.criteria.success import Success
from lgvi_warp.robustness.sweeps.cases import RARE
from lgvi_warp.robustness.sweeps.setup import Setup, SweepCell
from lgvi_warp.sampling.designs.table import Table
from lgvi_warp.statistics.estimates import paired
from lgvi_warp.uncertainty.rare.answer import RareEvent
from lgvi_warp.uncertainty.rare.cheaper import SETTINGS
from lgvi_warp.uncertainty.rare.failing import failing_of
from lgvi_warp.uncertainty.rare.limit import VehicleLimit
from lgvi_warp.uncertainty.rare.rare_event import check_asked, rare_event
from lgvi_warp.uncertainty.rare.ratio import FailingMembers, RareRatio, Share, members_of, ratio_of, shared

# Defaults of the function for what a case may leave out.
# Folder of the answers, within that of the sweep.
FOLDER = "rare"


@dataclass(frozen=True, eq=False)
class RareFailure:
    """Rare failure of a cell: the answer and the failing members that other cases run, or the refusal."""

    found: RareEvent | None
    members: FailingMembers | None = None
    refused: str = ""

    @classmethod
    def of(cls, found: RareEvent) -> RareFailure:
        """Reduce an answer to the failing members that comparisons need, so that it is small."""
        members, count = members_of(found), found.normals.shape[1]
        numbers, draws = members.u[:, :count], members.u[:, count:]
        failing = None
        if found.failing is not None:
            rows = _places(numbers, found.normals)
            failing = Table(values={name: values[rows] for name, values in found.failing.own_values().items()})
        return cls(
            replace(
                found,
                failing=failing,
                normals=numbers,
                draws=draws,
                weights=members.weights,
                ancestors=members.ancestors,
            ),
            members,
        )


def _places(u: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Index of each row of `u` (m, d) among the rows (k, d)."""
    places = {row.tobytes(): i for i, row in enumerate(np.ascontiguousarray(among))}
    return np.array([places[row.tobytes()] for row in np.ascontiguousarray(u)])


@dataclass(frozen=True)
class RareComparison:
    """Ratio of the failure probabilities of a second and a first case at a point; p_holm: p corrected by Holm."""

    first: str
    second: str
    point: Mapping[str, Any]
    probabilities: tuple[float, float]
    ratio: RareRatio
    p_holm: float = np.nan
    real: bool = False

    def row(self) -> dict[str, Any]:
        """The comparison as a record of a table."""
        ratio = self.ratio
        return {"first": self.first, "second": self.second, **self.point, "probability_first": self.probabilities[0],
                "probability_second": self.probabilities[1], "ratio": ratio.value, "lower": ratio.lower,
                "upper": ratio.upper, "p": ratio.p, "p_holm": self.p_holm, "real": self.real,
                "by": "failing members of either in both" if ratio.paired else "two answers"}  # fmt: skip


@dataclass(eq=False)
class RareFailures:
    """The rare failures of all cells that request them; folder: folder of the sweep, None to keep them in memory."""

    setup: Setup
    success: Success
    folder: Path | None = None
    confidence: float = 0.95
    threads: int | None = None
    _answers: dict[str, RareFailure] = field(default_factory=dict)
    _shares: dict[tuple[str, str], Share] = field(default_factory=dict)

    def __post_init__(self) -> None:
        faults = Faults()
        for name in self.setup.settings.keys() - SETTINGS:
            faults.add(name, "...", "is nothing that rare failures can take", "leave it out, or rare")
        for case in self.setup.cases:
            if asked := self.asked(case):
                own = Faults(f"case {case.name!r}: rare.")
                check_asked(own, asked["relative_error"], asked["most"])
                with faults.including():
                    own.raise_if_any()
        faults.raise_if_any()

    @staticmethod
    def asked(case: Any) -> dict[str, Any]:
        """Arguments of `rare_event` for a case, its own or the defaults; empty if the case does not request it."""
        rare = getattr(case, "rare", None)
        if not rare:
            return {}
        defaults = inspect.signature(rare_event).parameters
        return {name: defaults[name].default for name in RARE} | (dict(rare) if isinstance(rare, Mapping) else {})

    def of(self, cell: SweepCell) -> RareFailure | None:
        """Rare failure of a cell; None if none was requested."""
        return self._answers.get(self._key(cell))

    def _key(self, cell: SweepCell) -> str:
        return key_of({"cell": cell.key, "success": self.success.to_dict(), "rare": self.asked(cell.case)})

    def run(
        self, cell: SweepCell, lasting: bool, progress: Callable[[float], None] | None, execution: Mapping[str, Any]
    ) -> None:
        """Estimate the probability that a member of a cell fails, or read it if it is stored.

        lasting: True if it is stored in files. execution: threads, executor and scheduler.
        """
        key, asked = self._key(cell), self.asked(cell.case)
        answer = self._read(key) if lasting else None
        if answer is None:
            assert cell.fleet is not None
            try:
                condition: Any = failing_of(self.success, self.setup.metrics, cell.fleet.scene)
                # Cells are compared as independent answers: each has its own seed.
                found = rare_event(cell.fleet, condition, seed=int(key[:7], 16), progress=progress or False, **asked,
                                   **self.setup.settings, **execution)  # fmt: skip
                answer = RareFailure.of(found)
                if lasting:
                    self._write(key, answer)
            except SceneError as error:
                answer = RareFailure(None, None, " ".join(str(error).split()))
        self._answers[key] = answer

    def _settings(self) -> dict[str, Any]:
        return {**self.setup.settings, "threads": self.threads}

    def limit(self, cell: SweepCell) -> VehicleLimit:
        """The limit function of a cell, positive if a member fails."""
        assert cell.fleet is not None
        condition = failing_of(self.success, self.setup.metrics, cell.fleet.scene)
        return VehicleLimit(cell.fleet, condition, self._settings())

    def compare(self, pairs: Sequence[tuple[SweepCell, SweepCell]]) -> list[RareComparison]:
        """Compare pairs of cells whose answers are both known; Holm's method corrects p for their number."""
        rows, limits = list[RareComparison](), dict[str, VehicleLimit]()
        for first, second in pairs:
            if first.index == second.index or (a := self._found(first)) is None or (b := self._found(second)) is None:
                continue
            shares = self._share(first, second, limits), self._share(second, first, limits)
            names, probabilities = (first.case.name, second.case.name), (a.probability, b.probability)
            rows.append(RareComparison(*names, first.point, probabilities, ratio_of(a, b, *shares, self.confidence)))
        levels = paired.holm(np.array([row.ratio.p for row in rows]))
        return [replace(row, p_holm=float(p), real=bool(p < 1.0 - self.confidence))
                for row, p in zip(rows, levels, strict=True)]  # fmt: skip

    def _found(self, cell: SweepCell) -> RareEvent | None:
        """The answer of a cell; None if there is none."""
        answer = self.of(cell)
        return None if answer is None else answer.found

    def _share(self, first: SweepCell, second: SweepCell, limits: dict[str, VehicleLimit]) -> Share:
        """Fraction of a cell's failing members that also fail in another cell; limits: limit functions by key."""
        keys = self._key(first), self._key(second)
        if keys not in self._shares:
            for cell in (first, second):
                limits.setdefault(cell.key, self.limit(cell))
            answer = self.of(first)
            assert answer is not None
            assert answer.members is not None
            self._shares[keys] = shared(answer.members, limits[first.key], limits[second.key])
        return self._shares[keys]

    def _path(self, key: str) -> Path:
        assert self.folder is not None
        return self.folder / FOLDER / f"{key}.npz"

    def _write(self, key: str, answer: RareFailure) -> None:
        """Write an answer; a file is never partly written."""
        if self.folder is None or answer.found is None or answer.members is None:
            return
        # No file holds times: they differ from run to run, where all else is the same to the byte.
        nothing = np.zeros((0, 0))
        small = replace(
            answer.found, normals=nothing, draws=nothing, ancestors=np.zeros(0, int), seconds=0.0, plain_seconds=0.0
        )
        words = np.frombuffer(json.dumps({"key": key, "found": small.to_dict()}).encode(), np.uint8)
        place_of(self._path(key), self.folder).parent.mkdir(parents=True, exist_ok=True)
        write_npz(self._path(key), {"words": words, "u": answer.members.u, "weights": answer.members.weights,
                                    "ancestors": answer.members.ancestors},
                  self.folder)  # fmt: skip

    def _read(self, key: str) -> RareFailure | None:
        """Read an answer from a file; None if the file is missing, damaged or of another cell."""
        if self.folder is None:
            return None
        try:
            arrays = of_npz(self._path(key))
            words, u = parsed(arrays["words"].tobytes()), arrays["u"]
            members = FailingMembers(u, arrays["weights"], arrays["ancestors"])
            if words["key"] != key or not len(u) == len(members.weights) == len(members.ancestors):
                return None
            count = len(words["found"]["moved"])
            found = RareEvent.from_dict(
                words["found"] | {"normals": u[:, :count], "draws": u[:, count:]} | {"ancestors": members.ancestors}
            )
            found = replace(found, seconds=np.nan, plain_seconds=np.nan)
            return RareFailure(found, members)
        except (OSError, ValueError, KeyError, TypeError):
            return None
