"""Where a method holds: maps of accurate, bounded, flagged, failed and silently wrong runs over two parameters."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.status import Status, failed, stopped
from lgvi_warp.common.tables import write_csv
from lgvi_warp.engine import plan
from lgvi_warp.runs.provenance import provenance
from lgvi_warp.scene.scene import Scene
from lgvi_warp.studies.compared import QUANTITIES, compared_in
from lgvi_warp.studies.speed import void
from lgvi_warp.studies.stability.grid import Grid, Line
from lgvi_warp.studies.stability.limits import LIMITS
from lgvi_warp.studies.stability.runs import (
    LEAST_DRIVEN,
    REFUSED,
    SHORTEST,
    Found,
    column,
    judged,
    make_references,
    plan_of,
    refusals,
    run_method,
)
from lgvi_warp.studies.tradeoff import chosen_methods, finite_or_none

METHODS = ("psi", "psi_s", "psi_x", "rk4")
# Maps by name: their two axes.
GRIDS = {"omega": ("h", "angular_velocity"), "mass": ("h", "added_mass_ratio"), "drag": ("h", "drag_number")}


class Cell(IntEnum):
    """What became of the members of a cell, the worst of its directions."""

    ACCURATE = 0
    BOUNDED = 1
    FLAGGED = 2
    FAILED = 3
    SILENT = 4

    @property
    def text(self) -> str:
        """What it means, in a few words."""
        return TEXTS[self]


TEXTS = {
    Cell.ACCURATE: "error below the bound",
    Cell.BOUNDED: "error above it, energy bounded",
    Cell.FLAGGED: "status or warning, energy bounded",
    Cell.FAILED: "unbounded or not finite, flagged",
    Cell.SILENT: "unbounded without any flag",
}


@dataclass(frozen=True, eq=False)
class StabilityMap:
    """Classes of cells over two axes, for each method.

    x, y: lines of nx and ny values. classes: method -> (ny, nx), Cell. errors: largest error [unit of `of`] up to
    error_time, infinite without one; energies: largest growth of energy over the bound, above 1 where it is unbounded;
    statuses: the worst Status code (255: the program refused to run it). ratios: method -> limit -> (ny, nx), h over the
    analytic limit of the fastest direction (see stability_limits.LIMITS), above 1 beyond it. error_bound [unit of `of`];
    error_time and t1 [s], each rounded up to whole steps. judged: how energies are ("conservative", "dissipative" or
    "driven"). unverified: cells whose reference was not good enough, which so cannot be accurate. refused: method -> why.
    """

    x: Line
    y: Line
    classes: dict[str, np.ndarray]
    errors: dict[str, np.ndarray]
    energies: dict[str, np.ndarray]
    statuses: dict[str, np.ndarray]
    ratios: dict[str, dict[str, np.ndarray]]
    of: str
    error_bound: float
    error_time: float
    t1: float
    directions: int
    judged: str
    reference: str
    unverified: int
    provenance: dict[str, Any]
    refused: dict[str, str] = field(default_factory=dict)
    messages: tuple[str, ...] = ()
    seconds: float = 0.0
    unit: str = ""

    def __post_init__(self) -> None:
        if not self.unit:  # of what was written before there were others
            object.__setattr__(self, "unit", QUANTITIES.get(self.of, "1"))

    @property
    def methods(self) -> tuple[str, ...]:
        """Methods of the map."""
        return tuple(self.classes)

    def limit(self, method: str, worst: Cell = Cell.BOUNDED) -> np.ndarray:
        """The measured limit per y (ny,): the largest x up to which all cells are at most `worst`; NaN where the first is not.

        The last x where the whole row is: the limit then lies beyond the map.
        """
        good = np.logical_and.accumulate(self._of(method) <= worst, axis=1).sum(axis=1)
        return np.where(good > 0, self.x.values[np.maximum(good - 1, 0)], np.nan)

    def counts(self, method: str) -> dict[str, int]:
        """Cells by class."""
        return {cell.name.lower(): int(np.sum(self._of(method) == cell)) for cell in Cell}

    def silent(self, method: str) -> list[tuple[float, float]]:
        """(x, y) of the cells whose energy is unbounded without any flag: what must never happen."""
        return [
            (float(self.x.values[j]), float(self.y.values[i])) for i, j in np.argwhere(self._of(method) == Cell.SILENT)
        ]

    def _of(self, method: str) -> np.ndarray:
        faults = Faults()
        faults.choice("method", method, self.classes)
        faults.raise_if_any()
        return self.classes[method]

    def to_dict(self) -> dict[str, Any]:
        """Everything, as JSON holds it; what is not finite is None."""
        content = {name: value for name, value in vars(self).items() if name not in ("x", "y", *ARRAYS, "ratios")}
        content |= {"x": self.x.to_dict(), "y": self.y.to_dict(), "messages": list(self.messages)}
        for name in ARRAYS:
            content[name] = {method: values.tolist() for method, values in getattr(self, name).items()}
        content["ratios"] = {method: {limit: values.tolist() for limit, values in found.items()}
                             for method, found in self.ratios.items()}  # fmt: skip
        content["limits"] = {method: self.limit(method).tolist() for method in self.methods}
        content["legend"] = {str(int(cell)): f"{cell.name.lower()}: {cell.text}" for cell in Cell}
        return dict(finite_or_none(content))

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> StabilityMap:
        """From what `to_dict` gave."""
        kept = {name: value for name, value in content.items() if name not in ("limits", "legend")}
        kept |= {"x": Line.from_dict(content["x"]), "y": Line.from_dict(content["y"])}
        for name, kind in ARRAYS.items():
            kept[name] = {method: _array(values, kind) for method, values in content[name].items()}
        kept["ratios"] = {method: {limit: _array(values, np.float64) for limit, values in found.items()}
                          for method, found in content["ratios"].items()}  # fmt: skip
        return cls(**kept | {"messages": tuple(content["messages"])})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> StabilityMap:
        """Read the JSON that `save` wrote. Raises OSError or ValueError if it is none."""
        return cls.from_dict(json.loads(Path(path).read_text()))

    def rows(self) -> list[dict[str, Any]]:
        """A flat record for each cell and method."""
        rows = []
        for method in self.methods:
            for i, j in np.ndindex(self.classes[method].shape):
                row = {"method": method, self.x.name: self.x.values[j], self.y.name: self.y.values[i]}
                row |= {
                    "class": Cell(int(self.classes[method][i, j])).name.lower(),
                    f"error_{self.of}": self.errors[method][i, j],
                }
                row |= {
                    "energy_growth": self.energies[method][i, j],
                    "status": status_name(int(self.statuses[method][i, j])),
                }
                rows.append(
                    row | {f"h_over_{name}_limit": values[i, j] for name, values in self.ratios[method].items()}
                )
        return rows

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the rows to a CSV file. Returns its path."""
        return write_csv(self.rows(), path)

    def save(self, folder: str | os.PathLike[str], name: str = "stability") -> list[Path]:
        """Write NAME.json and NAME.csv into a folder. Returns their paths."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        (target / f"{name}.json").write_text(json.dumps(self.to_dict(), indent=1, allow_nan=False))
        return [target / f"{name}.json", self.to_csv(target / f"{name}.csv")]


# Arrays (ny, nx) by method, and their types.
ARRAYS: dict[str, Any] = {"classes": np.int64, "errors": np.float64, "energies": np.float64, "statuses": np.int64}


def _array(values: Any, kind: Any) -> np.ndarray:
    """An array; None is infinite."""
    array = np.array(values, dtype=object)
    return np.asarray(np.where(array == np.array(None), np.inf, array).astype(kind))


def status_name(code: int) -> str:
    """In small letters."""
    return "refused" if code == REFUSED else Status(code).name.lower()


def stability_map(
    scene: Scene,
    x: Any = "h",
    y: Any = "angular_velocity",
    methods: Sequence[str] | None = None,
    *,
    points: int | tuple[int, int] = 24,
    t1: float | None = None,
    error: float = 1e-2,
    of: Any = "attitude",
    error_time: float | None = None,
    energy_bound: float = 1.0,
    directions: int = 4,
    h: float | None = None,
    dtype: str | None = None,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> StabilityMap:
    """Run a grid of members by every method and say of each cell whether it is accurate, bounded, flagged, failed or silent.

    x, y: axes: "h", "angular_velocity", "speed", "added_mass_ratio", "drag_number" or a name of scene.parameters(), as a
    text ("h=0.01:3", "vehicle.mass=50:500:linear"), as (name, low, high) or as a stability_grid.Axis. methods: names
    (default psi, psi_s, psi_x, rk4). points: cells along x and y, one number or two. directions: starts per cell, the
    scene's own and such of velocity and spin turned at random; the worst counts. h: the step [s], where it is on no axis.
    dtype: default the scene's. What the scene's ensemble varies is left out.

    of: any quantity that statistics know ("attitude", "position", "depth", "euler[1]", ...), or a lw.Quantity.

    A cell is accurate where the error of `of` stays below `error` [its unit] up to error_time [s] (default: one period of
    the fastest motion at the start), against a reference of fine steps that two runs agree on ten times better; bounded
    where only energy and rotation stay bounded up to t1 [s] (default: ten periods): a conservative scene's energy changes,
    a damped one's grows, by less than energy_bound times what the start's momenta can hold as kinetic energy plus what the
    potentials gave. It is flagged where that holds and a member got a status or a warning; failed where it does not and
    one was given, also for numbers that are not finite; silent where it does not and none was. What drives a scene (wrenches,
    thrusters, waves) changes its energy by right: there it is compared with the reference's, up to error_time or 16 steps.

    progress: called with the fraction of the work done. Raises SceneError naming every fault, and where noise acts.
    """
    begun, report = time.perf_counter(), progress or void
    dtype = dtype or scene.run.dtype
    names = chosen_methods(methods, METHODS)
    faults = Faults()
    asked, unit_of_error = None, ""
    with faults.including():
        asked = compared_in(of)
        unit_of_error = asked.unit
    for name, value, unit in (("error", error, unit_of_error), ("energy_bound", energy_bound, "1"),
                              *((name, value, "s") for name, value in (("t1", t1), ("error_time", error_time))
                                if value is not None)):  # fmt: skip
        faults.positive(name, value, unit)
    faults.choice("dtype", dtype, plan.DTYPES)
    grid = None
    with faults.including():
        both = (points, points) if isinstance(points, int) else tuple(points)
        grid = Grid(scene, x, y, both, directions, seed, h)
    faults.raise_if_any()
    assert grid is not None and asked is not None
    refused = refusals(grid, names, dtype)
    if len(refused) == len(names):
        raise SceneError([f"method {name}: {why}" for name, why in refused.items()])
    names = tuple(name for name in names if name not in refused)
    period = 2.0 * math.pi / grid.rate
    error_time = error_time or min(period, t1 or period)
    kind = judged(grid, names)
    t1 = error_time if kind == "driven" else max(t1 or 10.0 * period, error_time)
    least = LEAST_DRIVEN if kind == "driven" else 1
    columns = [column(step, members, error_time, t1, least) for step, members in grid.columns()]
    threads = threads or machine.thread_count()
    text = make_references(grid, columns, asked, error, threads, lambda part: report(0.4 * part))
    found, messages = {}, []
    for i, name in enumerate(names):
        one, why = run_method(grid, columns, name, dtype, asked, kind, threads)
        report(0.4 + 0.6 * (i + 1) / len(names))
        found[name] = one
        if why:
            messages.append(f"{name}: refused in {int(_worst(grid, one.status == REFUSED).sum())} cells: {why}")
    verified = np.zeros(len(grid.h), bool)
    for part in columns:
        verified[part.members] = part.verified
    classes = {name: _worst(grid, cells_of(one, verified, error, energy_bound)) for name, one in found.items()}
    line_x, line_y = grid.lines
    result = StabilityMap(
        x=line_x,
        y=line_y,
        classes=classes,
        errors={name: _worst(grid, one.error) for name, one in found.items()},
        energies={name: _worst(grid, one.growth / energy_bound) for name, one in found.items()},
        statuses={name: _worst_status(grid, one.status) for name, one in found.items()},
        ratios=_ratios(grid, list(found)),
        of=asked.name,
        unit=asked.unit,
        error_bound=float(error),
        error_time=float(error_time),
        t1=float(t1),
        directions=directions,
        judged=kind,
        reference=text,
        unverified=int(_worst(grid, ~verified).sum()),
        provenance=_provenance(grid, list(found), dtype, seed, energy_bound),
        refused=refused,
        messages=tuple(messages),
        seconds=time.perf_counter() - begun,
    )
    report(1.0)
    return result


def _worst(grid: Grid, values: np.ndarray) -> np.ndarray:
    """(ny, nx) of what members have: the largest over the directions of a cell."""
    return np.max(values.reshape(grid.shape), axis=2)


def _worst_status(grid: Grid, status: np.ndarray) -> np.ndarray:
    """(ny, nx): what the program refused before failures, those before events, and the latter before OK."""
    rank = np.where(stopped(status), status - 500, np.where(status == Status.OK, -1000, status)).reshape(grid.shape)
    chosen = np.argmax(rank, axis=2)[:, :, None]
    return np.take_along_axis(status.reshape(grid.shape), chosen, axis=2)[:, :, 0]


def cells_of(one: Found, verified: np.ndarray, error: float, energy_bound: float) -> np.ndarray:
    """The class of every member."""
    unbounded = ~(one.growth / energy_bound <= 1.0)
    flagged = one.warned | failed(one.status)
    accurate = verified & (one.error <= error)
    quiet = np.where(accurate, Cell.ACCURATE, Cell.BOUNDED)
    return np.where(unbounded, np.where(flagged, Cell.FAILED, Cell.SILENT), np.where(flagged, Cell.FLAGGED, quiet))


def _ratios(grid: Grid, methods: Sequence[str]) -> dict[str, dict[str, np.ndarray]]:
    """method -> limit -> h over the analytic limit; limits that a method has not, or that nothing reaches, are left out."""
    numbers = {name: _worst(grid, grid.h * rate) for name, rate in grid.rates().items()}
    found: dict[str, dict[str, np.ndarray]] = {}
    for method in methods:
        limits = {name: limit(method) for name, limit in LIMITS.items()}
        found[method] = {name: number / limits[name] for name, number in numbers.items()
                         if math.isfinite(limits[name]) and np.any(number)}  # fmt: skip
    return found


def _provenance(grid: Grid, methods: Sequence[str], dtype: str, seed: int, energy_bound: float) -> dict[str, Any]:
    """Scene, settings, versions, machine."""
    content = provenance(plan_of(grid, np.arange(1), methods[0], SHORTEST, "float64"))
    content = {name: content[name] for name in ("scene", "versions", "machine", "checks")}
    axes = {name: vars(axis) for name, axis in (("x", grid.x), ("y", grid.y))}
    return content | {
        "methods": list(methods),
        "dtype": dtype,
        "seed": seed,
        "energy_bound": energy_bound,
        "axes": axes,
    }


def report_text(found: StabilityMap) -> str:
    """The map in lines for people."""
    unit = found.unit
    lines = [f"note        {message}" for message in found.messages]
    lines += [
        f"map         {found.x.label} x {found.y.label}: {len(found.x.values)} x {len(found.y.values)} cells, "
        f"{found.directions} starts each, {found.seconds:.0f} s",
        f"accurate    {found.of} to {found.error_bound:g} {unit} up to {found.error_time:.3g} s; bounded: energy up to "
        f"{found.t1:.3g} s ({found.judged})",
        f"reference   {found.reference}" + (f"; not in {found.unverified} cells" if found.unverified else ""),
    ]
    if found.refused:
        lines.append(f"refused     {', '.join(f'{name}: {why}' for name, why in found.refused.items())}")
    heads = "".join(f"{cell.name.lower():>10}" for cell in Cell)
    lines += ["", f"{'cells':<18}{heads}   limit of {found.x.name} over {found.y.name}, least to most"]
    for method in found.methods:
        limit, numbers = found.limit(method), found.counts(method).values()
        good = limit[np.isfinite(limit)]
        span = f"{good.min():.3g} to {good.max():.3g}" if len(good) else "none"
        lines.append(f"{method:<18}" + "".join(f"{number:>10}" for number in numbers) + f"   {span} {found.x.unit}")
    return "\n".join(lines)
