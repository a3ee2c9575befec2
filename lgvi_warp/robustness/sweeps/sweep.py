# SPDX-License-Identifier: Apache-2.0
"""`sweep`: run cases of a closed loop at all points of a grid, on the same members."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from lgvi_warp.calls.solve import solve
from lgvi_warp.common.arguments import path_of
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.near import near_names
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.criteria.success import INTERVALS, success_of
from lgvi_warp.robustness.sweeps.output import Sweep
from lgvi_warp.robustness.sweeps.rare import RareFailures
from lgvi_warp.robustness.sweeps.rare_output import rare_against_baseline
from lgvi_warp.robustness.sweeps.record import Record, Records
from lgvi_warp.robustness.sweeps.setup import Setup, SweepCell, setup_of
from lgvi_warp.robustness.sweeps.sweep_table import SUCCESS
from lgvi_warp.robustness.sweeps.verdicts import matters_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

# Parts of the progress of a rare failure, where a cell's own members are one.
RARE_PARTS = 20
# Said of a cell whose function holds what cannot be compared.
NOT_KEPT = "cannot be told from other functions, so this cell runs in every call. Give version=1 where it takes one"


@shows_progress
@near_names(solve)
def sweep(
    scene: Scene | Ensemble | str | os.PathLike[str],
    cases: Any = None,
    grid: Mapping[str, Any] | None = None,
    *,
    vary: Mapping[str, Any] | None = None,
    members: int | None = None,
    seed: int | None = None,
    sampling: Any = None,
    metrics: Sequence[Any] = (),
    success: Any = None,
    baseline: str | None = None,
    confidence: float = 0.95,
    interval: str = "wilson",
    matters: Any = None,
    rare: Any = None,
    out: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    executor: Any = "threads",
    scheduler: str | None = None,
    progress: Callable[[float], None] | bool | None = None,
    **settings: Any,
) -> Sweep:
    """Compare controller designs on the same members: success rate, ranking, worst members.

    A cell is a case at a point of the grid. All cells have the same vehicles, starts, seas, sensor noise and faults:
    random numbers depend only on seed, member and name. In a cell, a number of `vary` is constant if the case sets it,
    and is ignored if the case does not have it. Cells that differ only in numbers share a kernel. If a case is refused
    or does not compile, the result records this, and the other cases run.

    A metric takes 8 bytes per member. With `out`, one cell at a time is in memory; without `out`, all cells are.

    Args:
        scene: The scene, the path of a scene file, or an Ensemble, whose scene, members, seed, vary and sampling are used.
        cases: Cases, or tables with `name`, `set` (numbers by name), `replace` (lists of parts, such as "laws"),
            `vehicle` (another vehicle, or some of its numbers) and `scene` (another scene); or {name of a case: its
            numbers}. Default: one case, the scene without changes.
        grid: Name of a number -> its values; every case is run at all combinations. By default no grid.
        vary: Distributions, as for Ensemble, in addition to the scene's; for the same name, they replace the scene's.
        members: Number of members of every cell; by default the scene's.
        seed: Seed of the members; by default the scene's.
        sampling: As for Ensemble; by default the scene's.
        metrics: Metrics, each one number of each member: lw.metrics.Overshoot("depth"), a table {"type": "iae", "of":
            "heading"}, "iae heading", or an expression over the path, "max(norm(demand))". "time_to_failure" is added.
        success: Conditions of success: {"status": "ok", "overshoot depth": {"below": 1.0}}. By default a member
            succeeds if it reaches the end of the run.
        baseline: Name of the case with which the others are compared; by default the first case.
        confidence: Confidence level of all intervals, between 0 and 1; by default 0.95.
        interval: Kind of the intervals of probabilities: "wilson" (default) or "clopper_pearson".
        matters: The smallest difference that matters: of success in percentage points, such as 1.0; or of success and
            metrics, {"success": 1.0, "overshoot depth": 0.1}, metrics in their units. A comparison then has a verdict:
            better or worse (by more than this difference), equivalent (the interval lies within it) or undecided. A
            smaller metric is better, unless `success` gives it only a lower limit. By default None.
        rare: True: in every cell whose case does not set `rare`, lw.rare_event estimates the probability, even if very
            small, that a member does not pass. A dict does the same and gives some arguments of lw.rare_event,
            {"relative_error": 0.2, "cheaper": [{"h": 0.1}], "most": 200_000}. To compare two cells, the failing members
            of each are also run in the other. None (default): only in cells whose case sets `rare`.
        out: Folder for finished cells: after an interruption, the same call continues and gives the same bytes. Cells
            whose numbers, metrics, functions or settings have changed run again. Your own functions are identified by
            their code and the objects it uses, or by a `version` given to lw.control.Callback or
            lw.metrics.CustomMetric.
        threads: As in lw.solve.
        executor: As in lw.solve; "threads" by default.
        scheduler: As in lw.solve; None by default.
        progress: As in lw.solve, over all cells; None, the default: nothing is shown.
        **settings: Further arguments of lw.solve, such as method, h, t1, dtype.

    Returns:
        The sweep: success, comparisons, ranks, the worst members and their causes, as tables, files and texts.

    Raises:
        SceneError: If arguments are wrong; the message names every fault.
        OSError: If the folder cannot be written.

    Examples:
        >>> import lgvi_warp as lw
        >>> controller = lw.Controller(
        ...     period=0.1,
        ...     guidance=[lw.control.SetPoint(heading=0.5)],
        ...     laws=[lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0)],
        ...     allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, 0, 0]])],
        ... )
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]}, controller=controller)
        >>> table = lw.sweep(
        ...     scene,
        ...     {"slow": {}, "quick": {"heading_pid.kp": 2.0}},
        ...     members=16,
        ...     vary={"control_fins.area": lw.distributions.Normal(relative=0.05)},
        ...     metrics=[lw.metrics.IAE("heading")],
        ...     h=0.05,
        ...     t1=30.0,
        ... )
        >>> table.cases, table.members_count
        (('slow', 'quick'), 16)
    """
    setup = setup_of(scene, cases, grid, vary, members, seed, sampling, metrics, settings, rare)
    execution = {"threads": threads, "executor": executor, "scheduler": scheduler}
    return swept(setup, success, baseline, confidence, interval, out, callback(progress), execution, matters)


def swept(
    setup: Setup, success: Any, baseline: str | None, confidence: float, interval: str,
    out: str | os.PathLike[str] | None, progress: Any, execution: Mapping[str, Any], matters: Any = None,
) -> Sweep:  # fmt: skip
    """Run the cells of a setup, as `sweep` says; execution: threads, executor and scheduler."""
    faults = Faults()
    level = faults.number("confidence", confidence, "1")
    if level is not None and not 0.0 < level < 1.0:
        faults.add("confidence", confidence, "is not between 0 and 1", "give 0.95")
    faults.choice("interval", interval, INTERVALS)
    baseline = setup.cases[0].name if baseline is None else baseline
    faults.choice("baseline", baseline, [case.name for case in setup.cases])
    conditions, least = None, dict[str, float]()
    with faults.including():
        least = matters_of(matters, tuple(setup.metrics), SUCCESS)
    with faults.including():
        conditions = success_of(success, tuple(setup.metrics))
    faults.raise_if_any()
    assert conditions is not None
    records = Records(None if out is None else path_of("out", out), list(setup.metrics), setup.members.members)
    rares = None
    if asking := sum(bool(case.rare) for case, _ in setup.cells):
        with faults.including():
            rares = RareFailures(setup, conditions, records.folder, float(confidence), execution["threads"])
        faults.raise_if_any()
    records.check()
    total = len(setup.cells) + RARE_PARTS * asking
    cells = list(_run(setup, records, progress, total, execution))
    found = Sweep(setup, cells, records, conditions, baseline, float(confidence), interval, rares, least)
    if rares is not None:
        _run_rare(rares, found, progress, total, execution)
    return found


def _run_rare(rares: RareFailures, answer: Sweep, progress: Any, total: int, execution: Mapping[str, Any]) -> None:
    """Find the requested rare failures, and compare them with the baseline's."""
    asking = [cell for cell in answer.cells if cell.case.rare and not answer.record(cell).refused]
    done = total - RARE_PARTS * len(asking)
    for i, cell in enumerate(asking):
        at = done + RARE_PARTS * i
        share = progress and (lambda part, at=at: progress((at + RARE_PARTS * part) / total))
        assert cell.fleet is not None
        rares.run(cell, answer.records.folder is not None and not answer.setup.unknown(cell.fleet), share, execution)
    rare_against_baseline(answer)
    if progress:
        progress(1.0)


def _run(
    setup: Setup, records: Records, progress: Any, total: int, execution: Mapping[str, Any]
) -> Iterator[SweepCell]:
    """Run the cells without a record, and record those that are refused; total: number of parts of the progress."""
    setup.note_functions()
    for i, (case, point) in enumerate(setup.cells):
        share = progress and (lambda part, i=i: progress((i + part) / total))
        fleet, key, fixed = None, f"refused {i}", list[str]()
        try:
            fleet, fixed = setup.fleet(case, point)
            key = setup.key(fleet)
            if records.get(key) is None:
                record = setup.run(fleet, **execution, progress=share)
                unknown = setup.unknown(fleet) if records.folder is not None else []
                messages = *record.messages, *(f"{place}: {NOT_KEPT}" for place in unknown)
                records.put(key, replace(record, messages=messages), lasting=not unknown)
        except SceneError as error:
            records.put(key, Record.of_refusal(" ".join(str(error).split())))
        if share:
            share(1.0)
        yield SweepCell(i, case, point, key, fleet, tuple(fixed))
