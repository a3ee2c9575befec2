# SPDX-License-Identifier: Apache-2.0
"""Variations by name: the numbers of a scene that a distribution draws, and the unit cube of the sampling points.

A name refers to a number of the scene, "vehicle.mass"; to an entry of it, "start.position[2]" or
"vehicle.inertia[0,1]"; or to several numbers with a joint distribution, "vehicle.mass, vehicle.buoyancy".
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, closest, refusal
from lgvi_warp.physics import notation
from lgvi_warp.physics import vehicle as vehicles
from lgvi_warp.sampling.designs.space import Space
from lgvi_warp.sampling.distributions.basic import Distribution
from lgvi_warp.sampling.distributions.joint import AttitudeDistribution, PhysicalInertia, PositiveDefinite
from lgvi_warp.scene.start import NAMES

# Parameters that are symmetric matrices, and stay so when they vary.
MATRICES = tuple(f"vehicle.{name}" for name in vehicles.SYMMETRIC)
ATTITUDE = "start.attitude"
# Most characters of a key: a longer one is not read.
LONGEST_KEY = 1000
# Those of MATRICES that belong to the rigid body, without added mass.
RIGID = ("vehicle.inertia", "vehicle.rigid_body_mass_matrix")


@dataclass(frozen=True)
class Target:
    """A number of the scene, or one entry of it if `index` is given."""

    name: str
    index: tuple[int, ...] | None = None

    @functools.cached_property
    def label(self) -> str:
        """The name with the index, such as "start.position[2]"."""
        return self.name if self.index is None else f"{self.name}[{','.join(map(str, self.index))}]"

    def of(self, array: np.ndarray) -> np.ndarray:
        """Return the target's value from the array of the number."""
        return np.asarray(array if self.index is None else array[self.index])


def targets(key: str) -> tuple[Target, ...]:
    """Parse the targets that a key names."""
    if not isinstance(key, str):
        raise refusal("vary", key, "is not a name of a quantity", 'give names such as "vehicle.mass"')
    if len(key) > LONGEST_KEY:
        return (Target(key),)
    listed = []
    for text in re.split(r",(?![^\[]*\])", key):
        match = re.fullmatch(r"([^\[\]]+)\[\s*(\d+(?:\s*,\s*\d+)*)\s*\]", text.strip())
        if match:
            listed.append(Target(match[1].strip(), tuple(int(digits) for digits in match[2].split(","))))
        else:
            listed.append(Target(text.strip()))
    return tuple(listed)


@dataclass(frozen=True, eq=False)
class Variation:
    """One key of `vary`, with its distribution and the scene's values of the drawn numbers."""

    key: str
    distribution: Any
    targets: tuple[Target, ...]
    wholes: tuple[np.ndarray, ...]

    @property
    def bases(self) -> list[np.ndarray]:
        """The scene's values in the form that the distribution draws; a symmetric matrix is given by its free entries."""
        return [self._base(target, array) for target, array in zip(self.targets, self.wholes, strict=True)]

    def _base(self, target: Target, array: np.ndarray) -> np.ndarray:
        matrix = target.name in MATRICES and target.index is None and not self._takes_matrices
        return drawn_entries(array) if matrix else target.of(array)

    @property
    def _takes_matrices(self) -> bool:
        chosen = self.distribution.joint and self.distribution.kind == "choice"
        return chosen or isinstance(self.distribution, PositiveDefinite)

    @property
    def size(self) -> int:
        """Number of uniform numbers that one draw takes."""
        bases = self.bases
        return int(self.distribution.size(bases)) if self.distribution.joint else max(1, bases[0].size)

    def labels(self) -> list[str]:
        """Return a label of each factor of the sampling."""
        (target, *_), (base, *_) = self.targets, self.bases
        if self.distribution.joint or base.ndim == 0:
            return [self.key]
        entries: Iterable[Sequence[int]] = np.ndindex(*base.shape)
        if target.name in MATRICES and target.index is None:
            d = len(self.wholes[0])
            entries = [(i, i) for i in range(d)] if base.size == d else np.argwhere(np.triu(np.ones((d, d)))).tolist()
        return [Target(target.name, tuple(int(i) for i in entry)).label for entry in entries]

    def values(self, u: np.ndarray) -> list[tuple[Target, np.ndarray]]:
        """The targets, each with its values (n, *shape) at points (n, size) of the unit cube."""
        bases = self.bases
        if self.distribution.joint:
            drawn = self.distribution.draw(u, bases)
        else:
            drawn = [self.distribution.quantile(u.reshape(len(u), *bases[0].shape), bases[0])]
        return [
            (target, symmetric(values, array) if values.shape[1:] != target.of(array).shape else values)
            for target, array, values in zip(self.targets, self.wholes, drawn, strict=True)
        ]


def diagonal(matrix: np.ndarray) -> bool:
    """Return whether all entries off a square matrix's diagonal are zero."""
    return not np.any(matrix - np.diag(np.diag(matrix)))


def drawn_entries(matrix: np.ndarray) -> np.ndarray:
    """The varied entries of a symmetric matrix (d, d): its diagonal if it is diagonal, else the upper triangle by rows."""
    return np.diag(matrix) if diagonal(matrix) else matrix[np.triu_indices(len(matrix))]


def symmetric(drawn: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Symmetric matrices (n, d, d) from entries (n, k) in the order of `drawn_entries`.

    matrix: The scene's matrix (d, d), which decides whether they are diagonal.
    """
    size = len(matrix)
    if diagonal(matrix):
        return drawn[:, :, None] * np.eye(size)
    upper = np.zeros((len(drawn), size, size))
    rows, columns = np.triu_indices(size)
    upper[:, rows, columns] = upper[:, columns, rows] = drawn
    return upper


def put(values: dict[str, np.ndarray], target: Target, drawn: np.ndarray, into: bool = False) -> None:
    """Set a target's values (n, ...) among the numbers (1 or n, ...) by name; into: Whether to change the array in place."""
    if target.index is None:
        values[target.name] = drawn
        return
    array = values[target.name]
    if not into:
        array, shared = np.empty((len(drawn), *array.shape[1:]), array.dtype), array
        array[...] = shared
    every: tuple[Any, ...] = (slice(None),)
    array[every + target.index] = drawn
    if target.name in MATRICES:
        array[every + target.index[::-1]] = drawn
    values[target.name] = array


def _hint(name: str, known: Mapping[str, np.ndarray], also: str) -> str:
    """Return a remedy for a name that the scene does not have."""
    section = name.split(".")[0]
    others = [key for key in known if key.split(".")[0] == section]
    if name == "start.geodetic":
        return 'vary "start.position" [m] around the place, or give every member its own by lw.designs.Table'
    of_start = section == "start" and others
    return (f"the scene gives {', '.join(others)}" if of_start else closest(name, known)) + also


def known_target(
    faults: Faults, key: str, distribution: Any, target: Target, known: Mapping[str, np.ndarray], also: str = ""
) -> bool:
    """Check that the scene has a target; add a fault if it does not."""
    if target.name not in known:
        remedy = functools.partial(_hint, target.name, known, also)
        faults.add(f'"{key}"', distribution, "does not name what the scene has", remedy)
        return False
    shape = known[target.name].shape
    if target.index is not None:
        if target.name == ATTITUDE:
            faults.add(f'"{key}"', distribution, "varies an entry of a rotation", ROTATIONS)
            return False
        if len(target.index) != len(shape) or any(i >= n for i, n in zip(target.index, shape, strict=True)):
            problem = f"is not an entry of {target.name}, of shape {shape}"
            form = f"give {len(shape)} numbers from 0" if shape else f'write "{target.name}"'
            faults.add(f'"{key}"', distribution, problem, form)
            return False
    return True


ROTATIONS = (
    "give lw.distributions.RotationNormal, lw.distributions.UniformRotation or a Choice of matrices; "
    "or vary rotation_vector or euler_deg instead"
)


def variation(faults: Faults, key: str, distribution: Any, known: Mapping[str, np.ndarray]) -> Variation | None:
    """Match a key of `vary` and its distribution with a scene; None after adding a fault."""
    if not isinstance(distribution, Distribution):
        remedy = (
            "give lw.distributions.Normal(std=...) or another, or an object with ppf(u), such as scipy.stats.gamma(2.0)"
        )
        faults.add(f'"{key}"', distribution, "is not a distribution", remedy)
        return None
    named = targets(key)
    with faults.including():
        distribution = distribution.ordered_as([target.label for target in named])
    if not all([known_target(faults, key, distribution, target, known) for target in named]):
        return None
    described = Variation(key, distribution, named, tuple(known[target.name] for target in named))
    wrong = _misfit(described)
    if wrong:
        faults.add(f'"{key}"', distribution, *wrong)
        return None
    return described


def _misfit(variation: Variation) -> tuple[str, str] | None:
    """Return the problem of a distribution with its targets and the remedy; None if they fit."""
    distribution, named = variation.distribution, variation.targets
    turns = isinstance(distribution, AttitudeDistribution)
    chosen = distribution.kind == "choice" and distribution.joint
    if len(named) > 1 and not distribution.several:
        return (
            "draws one quantity, several are named",
            "give lw.distributions.CorrelatedNormal, or a distribution to each",
        )
    attitude = any(target.name == ATTITUDE for target in named)
    if turns and not attitude:
        return "is a distribution of attitudes", f'vary "{ATTITUDE}"'
    if attitude and not (turns or chosen):
        return "cannot vary by entry", ROTATIONS
    if isinstance(distribution, PositiveDefinite):
        if named[0].name not in MATRICES or named[0].index is not None:
            return "is a distribution of symmetric matrices", f"vary one of {', '.join(MATRICES)}"
        if isinstance(distribution, PhysicalInertia) and named[0].name not in RIGID:
            return "is a distribution of a rigid body's inertia", "use PositiveDefinite for added mass"
    wrong: tuple[str, str] | None = distribution.fault([base.shape for base in variation.bases])
    if wrong is None and (width := distribution.nothing_of(variation.bases)):
        return f"is relative to the scene's value, 0, so that its {width} varies nothing", "give an absolute spread"
    if wrong is None and isinstance(distribution, PositiveDefinite):
        wrong = distribution.unusable(variation.wholes[0])
    if wrong is None and chosen:
        wrong = _no_such_matrices(named[0], np.asarray(distribution.values, dtype=np.float64))
    return wrong


def _no_such_matrices(target: Target, values: np.ndarray) -> tuple[str, str] | None:
    """Return the problem of matrices (k, d, d) to choose from and the remedy; None if they fit the target."""
    if target.name == ATTITUDE and not notation.rotations(values).all():
        which = int(np.argmin(notation.rotations(values)))
        return f"holds a matrix that is not a rotation to 1e-9 (number {which + 1})", "give R^T R = I, det R = 1"
    if target.name not in MATRICES or target.index is not None:
        return None
    skew = np.abs(values - np.swapaxes(values, 1, 2)).max() > 1e-9 * np.abs(values).max()
    return ("holds a matrix that is not symmetric", "give symmetric matrices") if skew else None


def clashes(faults: Faults, named: Iterable[tuple[str, tuple[Target, ...]]], done: str = "varied") -> None:
    """Add a fault for every number that is varied twice, by two keys or one; done: verb for the message."""
    taken: dict[str, list[tuple[tuple[int, ...] | None, str]]] = {}
    for key, wanted in named:
        for target in wanted:
            index = target.index
            if index is not None and target.name in MATRICES:
                index = tuple(sorted(index))
            for earlier, by_key in taken.setdefault(target.name, []):
                if index is None or earlier is None or index == earlier:
                    faults.add(f'"{key}"', target.label, f'is {done} by "{by_key}" as well', "keep one of them")
                    break
            taken[target.name].append((index, key))


def space(seed: int, variations: Sequence[Variation]) -> Space:
    """Return the unit cube of the sampling points."""
    ordered = sorted(variations, key=lambda varied: varied.key)
    factors: list[tuple[str, tuple[int, ...]]] = []
    first = 0
    for varied in ordered:
        labels, size = varied.labels(), varied.size
        if len(labels) == size:
            factors += [(label, (first + i,)) for i, label in enumerate(labels)]
        else:
            factors.append((labels[0], tuple(range(first, first + size))))
        first += size
    keys, sizes = (tuple(getattr(varied, name) for varied in ordered) for name in ("key", "size"))
    return Space(seed, keys, sizes, tuple(factors))


def check_names(vary: Mapping[str, Any], parameters: Sequence[str]) -> None:
    """Check that a scene has the names of all variations."""
    faults = Faults("ensemble.vary.")
    known = [*parameters, *(f"start.{name}" for name in NAMES)]
    for key, distribution in vary.items():
        for target in targets(key):
            if target.name not in known:
                remedy = functools.partial(closest, target.name, known)
                faults.add(f'"{key}"', distribution, "does not name what a scene has", remedy)
    faults.raise_if_any()
