"""What varies, by name: which numbers of a scene a law draws, and the unit cube that its levels are points of.

A name is that of a number of the scene, "vehicle.mass", of an entry of it, "start.position[2]" or "vehicle.inertia[0,1]",
or of several that one law draws together, "vehicle.mass, vehicle.buoyancy".
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.physics import notation
from lgvi_warp.physics import vehicle as vehicles
from lgvi_warp.sampling.designs.space import Space
from lgvi_warp.sampling.distributions.basic import Distribution, varies_nothing
from lgvi_warp.sampling.distributions.joint import PhysicalInertia, PositiveDefinite, RotationNormal, UniformRotation

# Parameters that are symmetric matrices, and stay so when they vary.
MATRICES = tuple(f"vehicle.{name}" for name in vehicles.SYMMETRIC)
ATTITUDE = "start.attitude"
# Characters of a key: a longer one names nothing.
LONGEST_KEY = 1000
# Which of them are of a rigid body by itself or may be.
RIGID = ("vehicle.inertia", "vehicle.rigid_body_mass_matrix")


@dataclass(frozen=True)
class Target:
    """A number of the scene by name, or the entry of it at `index`."""

    name: str
    index: tuple[int, ...] | None = None

    @property
    def label(self) -> str:
        """As it is written."""
        return self.name if self.index is None else f"{self.name}[{','.join(map(str, self.index))}]"

    def of(self, whole: np.ndarray) -> np.ndarray:
        """Its value, where the number is `whole`."""
        return np.asarray(whole if self.index is None else whole[self.index])


def targets(key: str) -> tuple[Target, ...]:
    """The numbers that a key names: "vehicle.mass", "start.position[2]", or several with commas between."""
    if len(key) > LONGEST_KEY:
        return (Target(key),)
    found = []
    for text in re.split(r",(?![^\[]*\])", key):
        match = re.fullmatch(r"([^\[\]]+)\[\s*(\d+(?:\s*,\s*\d+)*)\s*\]", text.strip())
        if match:
            found.append(Target(match[1].strip(), tuple(int(one) for one in match[2].split(","))))
        else:
            found.append(Target(text.strip()))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Variation:
    """One key of `vary`: its law, what it draws, and the scene's values of that (of a symmetric matrix its entries)."""

    key: str
    law: Any
    targets: tuple[Target, ...]
    wholes: tuple[np.ndarray, ...]

    @property
    def bases(self) -> list[np.ndarray]:
        """The scene's values in the form that the law draws."""
        return [self._base(target, whole) for target, whole in zip(self.targets, self.wholes, strict=True)]

    def _base(self, target: Target, whole: np.ndarray) -> np.ndarray:
        matrix = target.name in MATRICES and target.index is None and not self._takes_matrices
        return drawn_entries(whole) if matrix else target.of(whole)

    @property
    def _takes_matrices(self) -> bool:
        return isinstance(self.law, PositiveDefinite) or (self.law.joint and self.law.kind == "choice")

    @property
    def size(self) -> int:
        """Uniform numbers that a draw takes."""
        bases = self.bases
        return int(self.law.size(bases)) if self.law.joint else max(1, bases[0].size)

    def labels(self) -> list[str]:
        """Of each factor: the entries, or the key of a joint law."""
        (target, *_), (base, *_) = self.targets, self.bases
        if self.law.joint or base.ndim == 0:
            return [self.key]
        entries: Iterable[Sequence[int]] = np.ndindex(*base.shape)
        if target.name in MATRICES and target.index is None:
            d = len(self.wholes[0])
            entries = [(i, i) for i in range(d)] if base.size == d else np.argwhere(np.triu(np.ones((d, d)))).tolist()
        return [Target(target.name, tuple(int(i) for i in entry)).label for entry in entries]

    def values(self, u: np.ndarray) -> list[tuple[Target, np.ndarray]]:
        """(target, values (n, *shape)) of each target, at the levels u (n, size)."""
        bases = self.bases
        if self.law.joint:
            drawn = self.law.draw(u, bases)
        else:
            drawn = [self.law.quantile(u.reshape(len(u), *bases[0].shape), bases[0])]
        return [
            (target, symmetric(part, whole) if part.shape[1:] != target.of(whole).shape else part)
            for target, whole, part in zip(self.targets, self.wholes, drawn, strict=True)
        ]


def diagonal(matrix: np.ndarray) -> bool:
    """Whether a matrix is."""
    return not np.any(matrix - np.diag(np.diag(matrix)))


def drawn_entries(whole: np.ndarray) -> np.ndarray:
    """Of a symmetric matrix, what varies: its upper triangle, or the diagonal of a diagonal one."""
    return np.diag(whole) if diagonal(whole) else whole[np.triu_indices(len(whole))]


def symmetric(drawn: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Symmetric matrices (n, d, d) from such entries, where the scene's matrix is `whole`."""
    size = len(whole)
    if diagonal(whole):
        return drawn[:, :, None] * np.eye(size)
    upper = np.zeros((len(drawn), size, size))
    rows, columns = np.triu_indices(size)
    upper[:, rows, columns] = upper[:, columns, rows] = drawn
    return upper


def put(values: dict[str, np.ndarray], target: Target, drawn: np.ndarray) -> None:
    """Put a target's values (n, ...) into the numbers by name, which have a leading dimension of 1 or n."""
    if target.index is None:
        values[target.name] = drawn
        return
    whole = values[target.name]
    if len(whole) != len(drawn) or not whole.flags.writeable:
        whole = np.array(np.broadcast_to(whole, (len(drawn), *whole.shape[1:])))
    else:
        whole = whole.copy()
    every: tuple[Any, ...] = (slice(None),)
    whole[every + target.index] = drawn
    if target.name in MATRICES:
        whole[every + target.index[::-1]] = drawn
    values[target.name] = whole


def _hint(name: str, known: Mapping[str, np.ndarray], also: str) -> str:
    """How to mend a name that the scene has not."""
    section = name.split(".")[0]
    others = [one for one in known if one.split(".")[0] == section]
    given = section == "start" and others
    return (f"the scene gives {', '.join(others)}" if given else closest(name, known)) + also


def known_target(
    faults: Faults, key: str, law: Any, target: Target, known: Mapping[str, np.ndarray], also: str = ""
) -> bool:
    """Whether the scene has a target; notes what is wrong with it if not. also: another remedy for a name it has not."""
    if target.name not in known:
        remedy = functools.partial(_hint, target.name, known, also)
        faults.add(f'"{key}"', law, "does not name what the scene has", remedy)
        return False
    shape = known[target.name].shape
    if target.index is not None:
        if target.name == ATTITUDE:
            faults.add(f'"{key}"', law, "varies an entry of a rotation", ROTATIONS)
            return False
        if len(target.index) != len(shape) or any(i >= n for i, n in zip(target.index, shape, strict=True)):
            what = f"is no entry of {target.name}, of shape {shape}"
            faults.add(
                f'"{key}"', law, what, f"give {len(shape)} numbers from 0" if shape else f'write "{target.name}"'
            )
            return False
    return True


ROTATIONS = (
    "give lw.RotationNormal, lw.UniformRotation or a Choice of matrices; or vary rotation_vector or euler_deg instead"
)


def variation(faults: Faults, key: str, law: Any, known: Mapping[str, np.ndarray]) -> Variation | None:
    """What a key of `vary` and its law say about a scene with these numbers; None after noting every fault."""
    if not isinstance(law, Distribution):
        remedy = "give lw.Normal(std=...) or another, or an object with ppf(u), such as scipy.stats.gamma(2.0)"
        faults.add(f'"{key}"', law, "is not a distribution", remedy)
        return None
    named = targets(key)
    if not all([known_target(faults, key, law, target, known) for target in named]):
        return None
    found = Variation(key, law, named, tuple(known[target.name] for target in named))
    wrong = _misfit(found)
    if wrong:
        faults.add(f'"{key}"', law, *wrong)
        return None
    return found


def _misfit(found: Variation) -> tuple[str, str] | None:
    """(what is wrong, the remedy) with a law and its targets; None if they fit."""
    law, named = found.law, found.targets
    turns = isinstance(law, RotationNormal | UniformRotation)
    chosen = law.kind == "choice" and law.joint
    if len(named) > 1 and law.kind != "correlated_normal":
        return "draws one quantity, several are named", "give lw.CorrelatedNormal, or a law to each"
    attitude = any(target.name == ATTITUDE for target in named)
    if turns and not attitude:
        return "is a law of attitudes", f'vary "{ATTITUDE}"'
    if attitude and not (turns or chosen):
        return "cannot vary by entry", ROTATIONS
    if isinstance(law, PositiveDefinite):
        if named[0].name not in MATRICES or named[0].index is not None:
            return "is a law of symmetric matrices", f"vary one of {', '.join(MATRICES)}"
        if isinstance(law, PhysicalInertia) and named[0].name not in RIGID:
            return "is a law of a rigid body's inertia", "use PositiveDefinite for added mass"
    wrong: tuple[str, str] | None = law.fault([base.shape for base in found.bases])
    if wrong is None and (width := varies_nothing(law, found.bases)):
        return f"is relative to the scene's value, 0, so that its {width} varies nothing", "give an absolute spread"
    if wrong is None and isinstance(law, PositiveDefinite):
        wrong = law.unusable(found.wholes[0])
    if wrong is None and chosen:
        wrong = _no_such_matrices(named[0], np.asarray(law.values, dtype=np.float64))
    return wrong


def _no_such_matrices(target: Target, values: np.ndarray) -> tuple[str, str] | None:
    """(what is wrong, the remedy) with values (k, d, d) of a quantity that is a symmetric matrix or a rotation."""
    if target.name == ATTITUDE and not notation.rotations(values).all():
        which = int(np.argmin(notation.rotations(values)))
        return f"holds a matrix that is no rotation to 1e-9 (number {which + 1})", "give R^T R = I, det R = 1"
    if target.name not in MATRICES or target.index is not None:
        return None
    skew = np.abs(values - np.swapaxes(values, 1, 2)).max() > 1e-9 * np.abs(values).max()
    return ("holds a matrix that is not symmetric", "give symmetric matrices") if skew else None


def clashes(faults: Faults, named: Iterable[tuple[str, tuple[Target, ...]]]) -> None:
    """Note every number that is varied twice: by two keys, or twice by one."""
    seen: dict[str, list[tuple[tuple[int, ...] | None, str]]] = {}
    for key, wanted in named:
        for target in wanted:
            index = target.index
            if index is not None and target.name in MATRICES:
                index = tuple(sorted(index))
            for other, by in seen.setdefault(target.name, []):
                if index is None or other is None or index == other:
                    faults.add(f'"{key}"', target.label, f'is varied by "{by}" as well', "keep one of them")
                    break
            seen[target.name].append((index, key))


def space(seed: int, found: Sequence[Variation]) -> Space:
    """The unit cube of these variations, in the order of their keys."""
    ordered = sorted(found, key=lambda one: one.key)
    factors: list[tuple[str, tuple[int, ...]]] = []
    first = 0
    for one in ordered:
        labels, size = one.labels(), one.size
        if len(labels) == size:
            factors += [(label, (first + i,)) for i, label in enumerate(labels)]
        else:
            factors.append((labels[0], tuple(range(first, first + size))))
        first += size
    return Space(seed, tuple(one.key for one in ordered), tuple(one.size for one in ordered), tuple(factors))
