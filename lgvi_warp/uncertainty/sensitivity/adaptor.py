# SPDX-License-Identifier: Apache-2.0
"""A scene as a function of its varied numbers, in the array shapes of SALib and scipy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import prepare
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.labelled import is_labelled
from lgvi_warp.results.quantities import OfInterest
from lgvi_warp.sampling.designs.designs import salib_problem
from lgvi_warp.scene import variations
from lgvi_warp.scene.columns import as_given, columns_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.uncertainty.sensitivity.outputs import known_arguments


class ScalarModel:
    """Scene as a function of its varied numbers, for SALib, scipy and other libraries; the result of `model`.

    Args:
        scene: the scene.
        vary: name -> distribution, or only names.
        of: one or several quantities of interest, as in `sobol`.
        levels: True if X contains levels in (0, 1) instead of values.
        failed: "refuse" raises an error if members fail; "nan" returns NaN for these members.
        settings: further arguments of `lw.prepare`.

    Attributes:
        names: names of the d columns of X (d,), in the order of `vary`.
        scene, vary, of, levels, failed: the arguments.
        problem: description of the columns for SALib.

    Methods:
        distributions: distribution of each column, for scipy.
        scipy: run members with arrays in scipy's shape.

    Raises:
        SceneError: for faulty arguments; one message lists all faults.
    """

    def __init__(self, scene: Scene, vary: Any, of: Any, levels: bool, failed: str, settings: Mapping[str, Any]):
        self.scene, self.of, self.levels, self.failed = scene, of, levels, failed
        self.vary = dict(vary) if isinstance(vary, Mapping) else None
        self._progress = settings.get("progress")
        settings = {name: value for name, value in settings.items() if name != "progress"}
        self._prepared = prepare(scene, vary, of, levels=levels, failed=failed, **settings)
        self._fleet = Ensemble(scene, 1, 0, self.vary)
        self._variations = as_given(self._fleet)
        joint = [variation.key for variation in self._variations if variation.distribution.joint]
        if joint and not levels:
            raise SceneError([f"vary.\"{key}\": is a joint distribution, whose values are not single numbers. Use levels=True"
                              for key in joint])  # fmt: skip
        # Column of the ensemble's cube, whose keys are sorted, for each column of X.
        self._columns = [
            column for variation in self._variations for column in columns_of(self._fleet.space, variation.key)
        ]
        self.names = self._prepared.names

    @property
    def problem(self) -> dict[str, Any]:
        """Description of the columns for SALib.sample: num_vars, names, bounds, and dists or groups.

        With levels=True it describes the unit cube. Otherwise it describes the distributions, which SALib must support.

        Raises:
            SceneError: if SALib does not support a distribution, or if `vary` has only names.
        """
        if self.levels:
            cube = salib_problem(self._fleet.space)
            by_column = {key: [cube[key][column] for column in self._columns] for key in ("names", "bounds", "groups")
                         if key in cube}  # fmt: skip
            return cube | by_column
        faults = Faults("vary.")
        bounds, kinds = [], []
        for variation in self._variations:
            for distribution in entries_of(variation):
                described = salib_distribution(*distribution)
                if described is None:
                    faults.add(f'"{variation.key}"', variation.distribution, "is unknown to SALib", "use levels=True")
                    break
                kinds.append(described[0])
                bounds.append(described[1])
        if not self._variations:
            faults.add("names", list(self.names), "have no distributions", "map names to distributions")
        faults.raise_if_any()
        return {"num_vars": len(self.names), "names": list(self.names), "bounds": bounds, "dists": kinds}

    @property
    def distributions(self) -> list[Any]:
        """Distributions of the columns (d,), each with `ppf`, for scipy.stats.sobol_indices(dists=...).

        Raises:
            SceneError: if `vary` has only names.
        """
        if not self._variations:
            raise SceneError(["vary: names alone have no distributions. Map names to distributions"])
        return [_Levels() if self.levels else _Column(self._fleet, column) for column in self._columns]

    def __call__(self, X: Any, *, seed: int | None = None, indices: Any = None) -> np.ndarray:
        """Run members with these numbers and return their quantities; by default, row i always has the same noise.

        X: (n, d), with columns in the order of `names`; or columns by name, in any order: a data frame, a mapping, a
            structured array, an xarray Dataset. By name a whole vector may be given, "current.velocity": (n, 3).
        indices: (n,), index of the member whose noise each row gets. Default None for 0 to n - 1.
        Returns: Y (n,), or (n, m) for several numbers: SALib's shape.
        """
        return np.asarray(self._prepared(X, seed=seed, indices=indices, progress=self._progress))

    def scipy(self, X: Any, *, seed: int | None = None, indices: Any = None) -> np.ndarray:
        """Run n members, like a call of this object, with arrays in scipy's shape.

        Args:
            X: values (d, n), with one row for each of `names`, in this order; or values by name, in any order.
            seed: seed of the noise; None, the default: the seed is fixed.
            indices: (n,), index of the member whose noise each column of X gets; None, the default: 0 to n - 1.

        Returns:
            Y (n,), or (m, n) for m quantities.

        Raises:
            SceneError: if labels are missing, unknown or duplicate, or if an entry is not a real number.
            FailedMembers: with failed="refuse", if members failed.
        """
        if is_labelled(X):
            return np.ascontiguousarray(self(X, seed=seed, indices=indices).T)
        faults = Faults()
        array = faults.real("X", X, f"give an array of shape ({len(self.names)}, n)")
        faults.raise_if_any()
        return np.ascontiguousarray(self(np.asarray(array).T, seed=seed, indices=indices).T)


@dataclass(frozen=True)
class _Levels:
    """Uniform distribution on (0, 1): the value is the level itself."""

    def ppf(self, u: Any) -> np.ndarray:
        return np.asarray(u, dtype=np.float64)


@dataclass(frozen=True)
class _Column:
    """Distribution of the number that one column of an ensemble's unit cube determines."""

    fleet: Ensemble
    column: int

    def ppf(self, u: Any) -> np.ndarray:
        levels = np.reshape(np.asarray(u, dtype=np.float64), -1)
        cube = np.full((len(levels), self.fleet.space.dimensions), 0.5)
        cube[:, self.column] = np.clip(levels, 2.0**-53, 1.0 - 2.0**-53)
        label = self.fleet.space.factors[self.column][0]
        (wanted,) = variations.targets(label)
        split = self.fleet.space.split(cube)
        for variation in self.fleet.variations:
            for target, values in variation.values(split[variation.key]):
                if target == wanted:
                    return values.reshape(np.shape(u))
                if target.name == wanted.name and target.index is None and wanted.index is not None:
                    entry: tuple[Any, ...] = (slice(None), *wanted.index)
                    return values[entry].reshape(np.shape(u))
        raise KeyError(label)


def entries_of(estimate: Any) -> list[tuple[Any, np.ndarray, dict[str, np.ndarray]]]:
    """The distributions of a variation's entries, with the base and the numbers of each entry."""
    (base,) = estimate.bases
    distribution = estimate.distribution
    numbers = {name: np.broadcast_to(value, base.shape).reshape(-1)
               for name, value in distribution.numbers_by_name().items()
               if np.ndim(value) <= base.ndim and distribution.kind != "choice"}  # fmt: skip
    return [(distribution, value, {name: column[i] for name, column in numbers.items()})
            for i, value in enumerate(np.reshape(base, -1))]  # fmt: skip


def salib_distribution(distribution: Any, base: Any, numbers: Mapping[str, Any]) -> tuple[str, list[float]] | None:
    """Translate a distribution to SALib's (name, bounds); None if SALib does not have it."""
    base = float(base)
    mean = float(numbers.get("mean", base))
    if distribution.kind == "normal":
        return "norm", [mean, float(numbers["std"] if "std" in numbers else abs(base) * numbers["relative"])]
    if distribution.kind == "uniform":
        if "low" in numbers:
            return "unif", [float(numbers["low"]), float(numbers["high"])]
        half = float(numbers["half_width"] if "half_width" in numbers else abs(base) * numbers["relative"])
        return "unif", [base - half, base + half]
    if distribution.kind == "lognormal" and float(numbers.get("median", base)) > 0.0:
        return "lognorm", [float(np.log(numbers.get("median", base))), float(numbers["sigma"])]
    return None


@known_arguments()
def model(
    scene: Scene,
    vary: Mapping[Any, Any] | Sequence[str],
    of: OfInterest | Sequence[OfInterest],
    *,
    levels: bool = False,
    failed: str = "refuse",
    **settings: Any,
) -> ScalarModel:
    """Turn a scene into a function f of its varied numbers, for sensitivity analysis by other libraries.

    f(X) takes X (n, d): n members, d numbers. It returns Y (n,), or (n, m) for m quantities, as SALib needs. f.scipy(X)
    takes X (d, n). Row i of X has the noise of member i, unless a call gives `seed` or `indices`.

    Args:
        scene: the scene.
        vary: name -> distribution, or only names. `names` of the function lists the columns of X, in the same order.
        of: one or several quantities of interest, as in `sobol`.
        levels: True if X contains levels in (0, 1), which the distributions turn into values; joint distributions need
            levels=True. Default False: X contains values.
        failed: "refuse" raises an error if members fail; "nan" returns NaN for these members. Default "refuse".
        settings: further arguments of `lw.prepare` (method, h, t1, save, dtype, threads, common_noise), and `progress`.

    Returns:
        The function; X may also be a data frame, a mapping, a structured array or an xarray Dataset with columns by name.

    Raises:
        SceneError: if arguments are faulty; one message lists all faults.
        TypeError: for an argument that does not exist.

    Examples:
        >>> import lgvi_warp as lw
        >>> depth = lw.uq.model(lw.Scene.named("sphere"), ["start.position[2]"], "depth", method="psi_s", h=0.1, t1=1.0)
        >>> depth([[0.0], [2.0]])
        array([0., 2.])
    """
    return ScalarModel(scene, vary, of, levels, failed, settings)
