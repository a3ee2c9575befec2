"""Sensitivity: what of that which varies makes a quantity of interest vary. Sobol indices, Morris' screening, adaptors.

    found = lw.uq.sobol(scene, "position[2]", samples=1024, h=0.01, t1=60.0)
    print(found)

The designs and the estimates are SALib's (extra: uq).
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from lgvi_warp import sampling as samplings
from lgvi_warp.ensemble import Ensemble
from lgvi_warp.errors import Faults, SceneError
from lgvi_warp.quantities import OfInterest, Quantity, quantities
from lgvi_warp.saveat import FIELDS, SaveAt
from lgvi_warp.scene import EnsembleSettings, Scene
from lgvi_warp.solving import solve
from lgvi_warp.status import Status
from lgvi_warp.tables import write_csv

# Members that are run together: what is kept of their paths stays small.
AT_ONCE = 16_384
FAILED = ("refuse", "drop")
# Below this part of its size, a quantity that differs from member to member does so by round-off.
CONSTANT = 1e-14


class FailedMembers(SceneError):  # noqa: N818  (what happened, and no fault of the scene)
    """Members failed, and what was asked for does not follow from the others."""


@dataclass(frozen=True)
class Outputs:
    """Quantities (n, m) of n members, their labels, and which members failed; counts: members by name of status."""

    values: np.ndarray
    labels: tuple[str, ...]
    failed: np.ndarray
    counts: dict[str, int]
    provenance: dict[str, Any]

    def text(self, remedy: str) -> str:
        """How many failed, of what, and what to do."""
        bad = int(self.failed.sum())
        what = ", ".join(f"{name} {number}" for name, number in self.counts.items() if name != "ok")
        first = int(np.argmax(self.failed))
        return f"{bad} of {len(self.failed)} members failed ({what}; the first: member {first}); {remedy}"


def evaluate(
    fleet: Ensemble,
    of: OfInterest | Sequence[OfInterest],
    *,
    common_noise: bool = False,
    progress: Callable[[float], None] | None = None,
    save: SaveAt | None = None,
    **settings: Any,
) -> Outputs:
    """Run an ensemble, some thousands of members at a time, and keep the quantities of interest only.

    of: one or several, see `Quantity`. common_noise: whether laws with noise act on every member alike. save and settings:
    those of `lw.solve`. A member failed if its status says so or a quantity of it is not finite; stopped by an event it is
    as good as any. Raises SceneError.
    """
    asked = quantities(of)
    save = _samples(fleet.scene, asked, save)
    if common_noise:
        fleet = fleet.subset(np.arange(fleet.members))
        fleet.indices = np.zeros(fleet.members, dtype=np.int64)
    values, status, provenance = [], [], {}
    for first in range(0, fleet.members, AT_ONCE):
        chosen = np.arange(first, min(first + AT_ONCE, fleet.members))
        part = progress and _part(progress, first / fleet.members, len(chosen) / fleet.members)
        result = solve(fleet.subset(chosen), save=save, progress=part, **settings)
        values.append([one.values(result) for one in asked])
        status.append(np.asarray(result.status))
        provenance = result.provenance
    found = np.concatenate([np.concatenate(one, axis=1) for one in values])
    labels = [label for one, columns in zip(asked, values[0], strict=True) for label in one.labels(columns.shape[1])]
    ended = np.concatenate(status)
    finite = np.isfinite(found).all(axis=1)
    names = {Status(int(code)).name.lower(): int((ended == code).sum()) for code in np.unique(ended)}
    counts = names | ({"quantity not finite": int((~finite).sum())} if not finite.all() else {})
    failed = ((ended != Status.OK) & (ended < Status.SURFACE)) | ~finite
    return Outputs(found, tuple(labels), failed, counts, provenance | {"ensemble": fleet.to_dict()})


def _part(progress: Callable[[float], None], done: float, share: float) -> Callable[[float], None]:
    return lambda fraction: progress(done + share * fraction)


def _samples(scene: Scene, asked: Sequence[Quantity], save: SaveAt | None) -> SaveAt:
    """Which samples the quantities need. Raises SceneError where a path is asked for and none is kept."""
    if save is not None:
        return save
    fields = tuple(name for name in FIELDS if any(name in one.fields for one in asked))
    paths = [one.label for one in asked if one.path]
    if paths and scene.run.save_every is None:
        faults = Faults()
        faults.add(
            "save",
            None,
            f"is missing, and {paths[0]} looks over the path",
            "give save=lw.SaveAt(every=...) or [run] save_every",
        )
        faults.raise_if_any()
    given = any(callable(one.of) for one in asked)
    return SaveAt(every=scene.run.save_every if paths or given else None, fields=fields)


@dataclass(frozen=True, eq=False)
class Indices:
    """What an analysis found. factors (d,): what varies by itself; quantities (m,): what was looked at.

    mean, std (m,): of the quantities over the design. samples: groups or paths of the design that were used. members: that
    were run; failed: of these. confidence: level of the intervals, whose half widths are named ..._confidence.
    messages: what the user should know.
    """

    factors: tuple[str, ...]
    quantities: tuple[str, ...]
    mean: np.ndarray
    std: np.ndarray
    samples: int
    members: int
    failed: int
    confidence: float
    messages: tuple[str, ...]
    provenance: dict[str, Any] = field(repr=False)
    name: ClassVar[str] = ""
    columns: ClassVar[tuple[str, ...]] = ()
    # What of the columns has an interval.
    intervals: ClassVar[dict[str, str]] = {}

    def rows(self) -> Iterator[dict[str, Any]]:
        """One for each quantity, factor and index: quantity, factor, other, index, value, confidence."""
        for q, quantity in enumerate(self.quantities):
            for f, factor in enumerate(self.factors):
                for column in self.columns:
                    name = self.intervals.get(column)
                    half = getattr(self, name)[q, f] if name else np.nan
                    yield {"quantity": quantity, "factor": factor, "other": "", "index": column,
                           "value": float(getattr(self, column)[q, f]), "confidence": float(half)}  # fmt: skip

    def _heading(self) -> str:
        return f"{self.name}: {self.samples} samples, {self.members} members, {self.failed} failed"

    def __str__(self) -> str:
        """A table for each quantity."""
        width = max(len(one) for one in (*self.factors, "factor"))
        lines = [self._heading(), *(f"note: {message}" for message in self.messages)]
        for q, quantity in enumerate(self.quantities):
            lines += ["", f"{quantity}: mean {self.mean[q]:.6g}, standard deviation {self.std[q]:.3g}"]
            lines.append(f"  {'factor':<{width}}" + "".join(f"  {column:>21}" for column in self.columns))
            for f, factor in enumerate(self.factors):
                lines.append(
                    f"  {factor:<{width}}" + "".join(f"  {self._cell(column, q, f):>21}" for column in self.columns)
                )
            lines += self._more(q)
        lines.append(f"+- is half the {self.confidence:.0%} interval")
        return "\n".join(lines)

    def _cell(self, column: str, q: int, f: int) -> str:
        value = getattr(self, column)[q, f]
        name = self.intervals.get(column)
        return f"{value:.4g}" + (f" +- {getattr(self, name)[q, f]:.2g}" if name else "")

    def _more(self, q: int) -> list[str]:
        """Lines below a quantity's table."""
        return []

    def to_dict(self) -> dict[str, Any]:
        """Everything, as JSON holds it: None for what is not a number."""
        names = ("name", "factors", "quantities", "samples", "members", "failed", "confidence", "messages")
        numbers = {name: _plain(getattr(self, name)) for name in ("mean", "std")}
        return {name: _plain(getattr(self, name)) for name in names} | numbers | {
            "rows": [{key: _plain(value) for key, value in row.items()} for row in self.rows()], "provenance": self.provenance
        }  # fmt: skip

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write sensitivity.txt, .csv and .json into a folder. Returns their paths. Raises OSError."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        paths = [target / f"sensitivity.{ending}" for ending in ("txt", "csv", "json")]
        paths[0].write_text(f"{self}\n", encoding="utf-8")
        write_csv(list(self.rows()), paths[1])
        paths[2].write_text(json.dumps(self.to_dict(), indent=1), encoding="utf-8")
        return paths


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


@dataclass(frozen=True, eq=False)
class SobolIndices(Indices):
    """Parts of a quantity's variance. first, total (m, d): by a factor alone, and with all that it takes part in.

    second (m, d, d): by two together, beyond what each does alone; symmetric, NaN on the diagonal; None if not asked for.
    ..._confidence: half the interval. All of a quantity that does not vary are NaN, and a message says so.
    """

    first: np.ndarray
    first_confidence: np.ndarray
    total: np.ndarray
    total_confidence: np.ndarray
    second: np.ndarray | None
    second_confidence: np.ndarray | None
    name: ClassVar[str] = "Sobol indices"
    columns: ClassVar[tuple[str, ...]] = ("first", "total")
    intervals: ClassVar[dict[str, str]] = {"first": "first_confidence", "total": "total_confidence"}

    def rows(self) -> Iterator[dict[str, Any]]:
        """As of every analysis, and those of two factors together."""
        yield from super().rows()
        for q, j, k in self._pairs():
            assert self.second is not None and self.second_confidence is not None
            yield {"quantity": self.quantities[q], "factor": self.factors[j], "other": self.factors[k], "index": "second",
                   "value": float(self.second[q, j, k]), "confidence": float(self.second_confidence[q, j, k])}  # fmt: skip

    def _pairs(self) -> list[tuple[int, int, int]]:
        d = 0 if self.second is None else len(self.factors)
        return [(q, j, k) for q in range(len(self.quantities)) for j in range(d) for k in range(j + 1, d)]

    def _more(self, q: int) -> list[str]:
        """The pairs that matter most."""
        if self.second is None or self.second_confidence is None:
            return []
        pairs = [(self.second[q, j, k], self.second_confidence[q, j, k], j, k) for p, j, k in self._pairs() if p == q]
        pairs = sorted((one for one in pairs if one[0] > one[1]), reverse=True)[:10]
        return [
            f"  {self.factors[j]} with {self.factors[k]}: second {value:.4g} +- {half:.2g}"
            for value, half, j, k in pairs
        ]


@dataclass(frozen=True, eq=False)
class MorrisEffects(Indices):
    """Elementary effects on a quantity, in its units, per whole side of the unit cube. mu_star (m, d): mean of their sizes;
    mu: mean; sigma: standard deviation, large where a factor acts differently from place to place. mu and sigma of a factor
    of several numbers, such as an attitude, are NaN: a step moves all of them.
    """

    mu_star: np.ndarray
    mu_star_confidence: np.ndarray
    mu: np.ndarray
    sigma: np.ndarray
    name: ClassVar[str] = "Morris screening"
    columns: ClassVar[tuple[str, ...]] = ("mu_star", "mu", "sigma")
    intervals: ClassVar[dict[str, str]] = {"mu_star": "mu_star_confidence"}


def sobol(
    scene: Scene | Ensemble,
    of: OfInterest | Sequence[OfInterest],
    *,
    samples: int = 1024,
    vary: Mapping[Any, Any] | None = None,
    seed: int | None = None,
    second_order: bool = True,
    confidence: float = 0.95,
    resamples: int = 100,
    failed: str = "refuse",
    **settings: Any,
) -> SobolIndices:
    """Sobol indices of quantities of interest, by Saltelli's design and SALib's estimates.

    scene: a Scene, with what varies in its ensemble or in `vary`; or an Ensemble, for its scene, vary and seed. of:
    "position[2]" (at the end), "max(energy)" (over the path), a function of a Result to (n,) or (n, m), or several (see
    `Quantity`). samples: N, a power of two is best; N (2 d + 2) members are run for d factors, N (d + 2) without
    second_order. confidence, resamples: of the bootstrap's intervals. failed: "refuse", or "drop" to use the groups without
    a failed member only.
    settings: those of `lw.solve` (method, h, t1, save, dtype, threads, progress) and of `evaluate`.

    The factors vary independently: a joint law counts as one. Raises SceneError, and FailedMembers.
    """
    _check(samples, 2, confidence, resamples, failed)
    design = samplings.Saltelli(second_order)
    fleet = _designed(scene, vary, seed, design, samples)
    outputs = evaluate(fleet, of, **settings)
    return sobol_of(fleet, outputs, confidence=confidence, resamples=resamples, failed=failed)


def sobol_of(
    fleet: Ensemble, outputs: Outputs, *, confidence: float = 0.95, resamples: int = 100, failed: str = "refuse"
) -> SobolIndices:
    """The same from the outputs of an ensemble with Saltelli's design that was run already."""
    analyze = _salib("sobol")
    design = fleet.sampling
    assert isinstance(design, samplings.Saltelli)
    factors = tuple(label for label, _ in fleet.space.factors)
    Y, messages = _whole_groups(outputs, design.group_size(fleet.space), failed)
    m, d = Y.shape[1], len(factors)
    found = {name: np.full((m, d), np.nan) for name in ("S1", "S1_conf", "ST", "ST_conf")}
    found |= {name: np.full((m, d, d), np.nan) for name in ("S2", "S2_conf")}
    problem = {"num_vars": d, "names": list(factors), "bounds": [[0.0, 1.0]] * d}
    for q in _varying(Y, outputs.labels, messages):
        S = analyze(problem, Y[:, q].copy(), calc_second_order=design.second_order, num_resamples=resamples,
                    conf_level=confidence, seed=fleet.seed + 1)  # fmt: skip
        for name in found.keys() & S.keys():
            found[name][q] = S[name]
    for name in ("S2", "S2_conf"):  # SALib gives what is above the diagonal
        found[name] = np.where(np.isnan(found[name]), np.swapaxes(found[name], 1, 2), found[name])
    return SobolIndices(
        **_common(factors, outputs, Y, design.group_size(fleet.space), confidence, messages),
        first=found["S1"],
        first_confidence=found["S1_conf"],
        total=found["ST"],
        total_confidence=found["ST_conf"],
        second=found["S2"] if design.second_order else None,
        second_confidence=found["S2_conf"] if design.second_order else None,
    )


def morris(
    scene: Scene | Ensemble,
    of: OfInterest | Sequence[OfInterest],
    *,
    samples: int = 64,
    levels: int = 4,
    vary: Mapping[Any, Any] | None = None,
    seed: int | None = None,
    confidence: float = 0.95,
    resamples: int = 100,
    failed: str = "refuse",
    **settings: Any,
) -> MorrisEffects:
    """Morris' screening: which factors matter at all, for few members.

    samples: paths; samples (d + 1) members are run for d factors. levels: even, of the grid that paths go along; a step moves
    a factor by half of it. The rest as of `sobol`. Raises SceneError, and FailedMembers.
    """
    _check(samples, 2, confidence, resamples, failed)
    fleet = _designed(scene, vary, seed, samplings.Morris(levels), samples)
    outputs = evaluate(fleet, of, **settings)
    return morris_of(fleet, outputs, confidence=confidence, resamples=resamples, failed=failed)


def morris_of(
    fleet: Ensemble, outputs: Outputs, *, confidence: float = 0.95, resamples: int = 100, failed: str = "refuse"
) -> MorrisEffects:
    """The same from the outputs of an ensemble with Morris' design that was run already."""
    analyze = _salib("morris")
    design, space = fleet.sampling, fleet.space
    assert isinstance(design, samplings.Morris)
    group = design.group_size(space)
    kept = _good_rows(outputs, group, failed)
    Y, messages = _whole_groups(outputs, group, failed)
    X = design.design(space, np.arange(fleet.members))[kept]
    # A step moves the level by another part of the cube than SALib's number: p / 2 of its p parts.
    scale = design.levels / (design.levels - 1.0)
    factors = tuple(label for label, _ in space.factors)
    found = {name: np.full((Y.shape[1], len(factors)), np.nan) for name in ("mu", "mu_star", "sigma", "mu_star_conf")}
    for q in _varying(Y, outputs.labels, messages):
        S = analyze(samplings.salib_problem(space), X, Y[:, q].copy(), num_resamples=resamples, conf_level=confidence,
                    num_levels=design.levels, seed=fleet.seed)  # fmt: skip
        order = [list(S["names"]).index(label) for label, _ in space.factors]
        for name, values in found.items():
            values[q] = np.ma.filled(np.ma.masked_invalid(np.ma.array(S[name], dtype=float)), np.nan)[order] * scale
    for number, (_, columns) in enumerate(space.factors):
        if len(columns) > 1:  # a step moves several numbers, and has no sense of its own
            found["mu"][:, number] = found["sigma"][:, number] = np.nan
    return MorrisEffects(
        **_common(factors, outputs, Y, group, confidence, messages),
        mu_star=found["mu_star"],
        mu_star_confidence=found["mu_star_conf"],
        mu=found["mu"],
        sigma=found["sigma"],
    )


def _common(
    factors: tuple[str, ...], outputs: Outputs, Y: np.ndarray, group: int, confidence: float, messages: list[str]
) -> dict[str, Any]:
    """What every analysis has."""
    return {
        "factors": factors,
        "quantities": outputs.labels,
        "mean": Y.mean(axis=0),
        "std": Y.std(axis=0, ddof=1),
        "samples": len(Y) // group,
        "members": len(outputs.values),
        "failed": int(outputs.failed.sum()),
        "confidence": confidence,
        "messages": tuple(messages),
        "provenance": outputs.provenance,
    }


def _check(samples: Any, least: int, confidence: Any, resamples: Any, failed: Any) -> None:
    faults = Faults()
    for name, value, low in (("samples", samples, least), ("resamples", resamples, 2)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < low:
            faults.add(name, value, f"is not a whole number from {low}", f"give {low} or more")
    number = faults.number("confidence", confidence)
    if number is not None and not 0.0 < number < 1.0:
        faults.add("confidence", confidence, "is not between 0 and 1", "give a level, such as 0.95")
    faults.choice("failed", failed, FAILED)
    faults.raise_if_any()


def _designed(scene: Any, vary: Any, seed: int | None, design: samplings.Sampling, samples: int) -> Ensemble:
    """The ensemble of a design with so many groups."""
    if isinstance(scene, Ensemble):
        scene, known, known_seed = scene.scene, scene.vary, scene.seed
    elif isinstance(scene, Scene):
        own = scene.ensemble_settings or EnsembleSettings()
        known, known_seed = dict(own.vary), own.seed
    else:
        raise SceneError([f"scene = {scene!r}: is neither a Scene nor an Ensemble; give lw.Scene(...)"])
    chosen = (known if vary is None else vary, known_seed if seed is None else seed)
    first = Ensemble(scene, None, chosen[1], chosen[0], design)
    return Ensemble(scene, samples * design.group_size(first.space), chosen[1], chosen[0], design)


def _salib(name: str) -> Callable[..., Any]:
    try:
        from importlib import import_module

        return getattr(import_module(f"SALib.analyze.{name}"), "analyze")  # noqa: B009
    except ImportError as error:
        raise ImportError("sensitivity needs SALib: pip install 'lgvi-warp[uq]'") from error


def _good_rows(outputs: Outputs, group: int, failed: str) -> np.ndarray:
    """(n,), the members of groups without a failure."""
    if outputs.failed.any() and failed == "refuse":
        remedy = 'mend what fails (see result.status of lw.solve), or use the whole groups alone: failed="drop"'
        raise FailedMembers([outputs.text(remedy)])
    good = ~outputs.failed.reshape(-1, group).any(axis=1)
    if good.sum() < 2:
        raise FailedMembers(
            [outputs.text(f"{int(good.sum())} groups of the design are whole, too few for an estimate")]
        )
    return np.repeat(good, group)


def _whole_groups(outputs: Outputs, group: int, failed: str) -> tuple[np.ndarray, list[str]]:
    """The quantities of groups without a failure, and what is to be said about the others."""
    kept = _good_rows(outputs, group, failed)
    messages = []
    if not kept.all():
        left = int((~kept).sum()) // group
        messages.append(outputs.text(f"the {left} of {len(kept) // group} groups that they are in were left out, and "
                                     "what remains may not be typical"))  # fmt: skip
    stopped = sum(number for name, number in outputs.counts.items() if name.upper() in Status.__members__
                  and Status[name.upper()].stopped)  # fmt: skip
    if stopped:
        messages.append(f"{stopped} of {len(kept)} members were stopped by events: their numbers are those at the stop")
    return outputs.values[kept], messages


def _varying(Y: np.ndarray, labels: Sequence[str], messages: list[str]) -> list[int]:
    """Quantities that vary; notes those that do not."""
    constant = np.ptp(Y, axis=0) <= CONSTANT * np.abs(Y).max(axis=0)
    messages += [f"{labels[int(q)]} does not vary: it has no indices" for q in np.flatnonzero(constant)]
    return [int(q) for q in np.flatnonzero(~constant)]


class Model:
    """A scene as a function of what varies, for SALib, scipy and other libraries; see `model`.

    names (d,): of the columns. problem: SALib's description. distributions (d,): each with `ppf`, for scipy.
    """

    def __init__(self, scene: Scene, vary: Any, of: Any, levels: bool, failed: str, settings: Mapping[str, Any]):
        self.scene, self.of, self.levels, self.failed, self._settings = scene, of, levels, failed, dict(settings)
        quantities(of)
        faults = Faults()
        faults.choice("failed", failed, ("refuse", "nan"))
        faults.raise_if_any()
        self.vary = dict(vary) if isinstance(vary, Mapping) else None
        if self.vary is None and levels:
            raise SceneError([f"vary = {vary!r}: names no laws that levels could be of; map names to distributions"])
        self._fleet = Ensemble(scene, 1, 0, self.vary)
        joint = [one.key for one in self._fleet._variations if one.law.joint]
        if joint and not levels:
            raise SceneError([f"vary.\"{key}\": is a joint law, whose values are no numbers by themselves; use levels=True"
                              for key in joint])  # fmt: skip
        if self.vary is None:
            self.names = tuple(str(name) for name in vary)
            self._run(np.array([[float(self._scene_value(name)) for name in self.names]]), dry=True)
        elif levels:
            self.names = tuple(samplings.salib_problem(self._fleet.space)["names"])
        else:
            self.names = tuple(label for label, _ in self._fleet.space.factors)

    def _scene_value(self, name: str) -> Any:
        from lgvi_warp import variations

        (target,) = variations.targets(name)
        known = self.scene.parameters() | {f"start.{key}": value for key, value in self.scene.start.given().items()}
        faults = Faults("vary.")
        if variations.known_target(faults, name, "...", target, known) and target.of(known[target.name]).ndim:
            faults.add(f'"{name}"', "...", "is no single number", f'name its entries, such as "{name}[0]"')
        faults.raise_if_any()
        return target.of(known[target.name])

    @property
    def problem(self) -> dict[str, Any]:
        """For SALib.sample: with levels, the unit cube. Otherwise laws that SALib knows too. Raises SceneError."""
        if self.levels:
            return samplings.salib_problem(self._fleet.space)
        faults = Faults("vary.")
        bounds, kinds = [], []
        for one in self._fleet._variations:
            for law in self._single_laws(one):
                described = _salib_law(*law)
                if described is None:
                    faults.add(f'"{one.key}"', one.law, "is no law that SALib has", "use levels=True")
                    break
                kinds.append(described[0])
                bounds.append(described[1])
        if not self._fleet._variations:
            faults.add("names", list(self.names), "have no laws", "map names to distributions")
        faults.raise_if_any()
        return {"num_vars": len(self.names), "names": list(self.names), "bounds": bounds, "dists": kinds}

    @staticmethod
    def _single_laws(one: Any) -> list[tuple[Any, np.ndarray, dict[str, np.ndarray]]]:
        """(law, the scene's value, the law's numbers) of each entry."""
        (base,) = one.bases
        numbers = {name: np.broadcast_to(value, base.shape).reshape(-1) for name, value in one.law._given().items()
                   if np.ndim(value) <= base.ndim and one.law.kind != "choice"}  # fmt: skip
        return [(one.law, value, {name: column[i] for name, column in numbers.items()})
                for i, value in enumerate(np.reshape(base, -1))]  # fmt: skip

    @property
    def distributions(self) -> list[Any]:
        """One for each column, with `ppf`: for scipy.stats.sobol_indices(dists=...)."""
        if not self._fleet._variations:
            raise SceneError(["vary: names without laws have no distributions; map names to distributions"])
        columns = range(len(self.names))
        return [_Levels() for _ in columns] if self.levels else [_Column(self._fleet, column) for column in columns]

    def __call__(self, X: Any) -> np.ndarray:
        """SALib's shape: X (n, d) -> Y (n,), or (n, m) of several numbers. Raises SceneError, and FailedMembers."""
        Y = self._run(np.asarray(X, dtype=np.float64))
        return Y[:, 0] if Y.shape[1] == 1 else Y

    def scipy(self, X: Any) -> np.ndarray:
        """scipy's shape: X (d, n) -> Y (n,), or (m, n) of several numbers. Raises SceneError, and FailedMembers."""
        return np.ascontiguousarray(self(np.asarray(X, dtype=np.float64).T).T)

    def _run(self, X: np.ndarray, dry: bool = False) -> np.ndarray:
        faults = Faults()
        if X.ndim != 2 or X.shape[1] != len(self.names):
            faults.add("X", "...", f"has shape {X.shape}", f"give an array of shape (n, {len(self.names)})")
        faults.raise_if_any()
        if self.levels:
            inside = np.clip(X, 2.0**-53, 1.0 - 2.0**-53)
            fleet = Ensemble(self.scene, None, 0, self.vary, samplings.Levels(inside))
        else:
            fleet = Ensemble(self.scene, None, 0, None, samplings.Table(values=dict(zip(self.names, X.T, strict=True))))
        if dry:
            return X
        outputs = evaluate(fleet, self.of, **self._settings)
        if outputs.failed.any():
            if self.failed == "refuse":
                raise FailedMembers([outputs.text('mend what fails, or take NaN for them: failed="nan"')])
            return np.where(outputs.failed[:, None], np.nan, outputs.values)
        return outputs.values


@dataclass(frozen=True)
class _Levels:
    """The level itself."""

    def ppf(self, u: Any) -> np.ndarray:
        return np.asarray(u, dtype=np.float64)


@dataclass(frozen=True)
class _Column:
    """One column of an ensemble's cube as a distribution of the number that follows from it."""

    fleet: Ensemble
    column: int

    def ppf(self, u: Any) -> np.ndarray:
        levels = np.reshape(np.asarray(u, dtype=np.float64), -1)
        cube = np.full((len(levels), self.fleet.space.dimensions), 0.5)
        cube[:, self.column] = np.clip(levels, 2.0**-53, 1.0 - 2.0**-53)
        label = self.fleet.space.factors[self.column][0]
        from lgvi_warp import variations

        (wanted,) = variations.targets(label)
        split = self.fleet.space.split(cube)
        for one in self.fleet._variations:
            for target, values in one.values(split[one.key]):
                if target == wanted:
                    return values.reshape(np.shape(u))
                if target.name == wanted.name and target.index is None and wanted.index is not None:
                    entry: tuple[Any, ...] = (slice(None), *wanted.index)
                    return values[entry].reshape(np.shape(u))
        raise KeyError(label)


def _salib_law(law: Any, base: Any, numbers: Mapping[str, Any]) -> tuple[str, list[float]] | None:
    """(name, bounds) of a law in SALib's words; None where it has no word for it."""
    base = float(base)
    mean = float(numbers.get("mean", base))
    if law.kind == "normal":
        return "norm", [mean, float(numbers["std"] if "std" in numbers else abs(base) * numbers["relative"])]
    if law.kind == "uniform":
        low, high = (float(law.quantile(np.array([u]), np.array(base)).reshape(-1)[0]) if np.ndim(law.high) == 0 else None
                     for u in (0.0, 1.0))  # fmt: skip
        if low is None or high is None:
            low, high = float(numbers["low"]), float(numbers["high"])
        return "unif", [low, high]
    if law.kind == "lognormal" and float(numbers.get("median", base)) > 0.0:
        return "lognorm", [float(np.log(numbers.get("median", base))), float(numbers["sigma"])]
    return None


def model(
    scene: Scene,
    vary: Mapping[Any, Any] | Sequence[str],
    of: OfInterest | Sequence[OfInterest],
    *,
    levels: bool = False,
    failed: str = "refuse",
    **settings: Any,
) -> Model:
    """A scene as a function: f(X), X (n, d) -> Y (n,) or (n, m), for SALib; f.scipy(X), X (d, n), for scipy's sobol_indices.

    vary: name -> distribution, or names alone. X holds the numbers themselves, of the entries that `names` lists; with levels,
    numbers in (0, 1) that the laws turn into values, which any law can be. of, settings: as of `sobol`. failed: "refuse", or
    "nan" for NaN in their place. Raises SceneError naming every fault.
    """
    return Model(scene, vary, of, levels, failed, settings)
