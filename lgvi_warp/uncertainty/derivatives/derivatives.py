# SPDX-License-Identifier: Apache-2.0
"""`derivatives`: derivatives of a run's outputs with respect to numbers of its scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from lgvi_warp.common.arguments import flag
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.results.quantities import OfInterest, OfResult, quantities
from lgvi_warp.runs.request import scene_of
from lgvi_warp.scene.columns import names_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.names import single_number
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.variations import Target, targets
from lgvi_warp.uncertainty.derivatives import undefined
from lgvi_warp.uncertainty.derivatives.answer import Derivatives
from lgvi_warp.uncertainty.derivatives.answering import Answering, SlopesQuestion


@shows_progress
def derivatives(
    fleet: Scene | Ensemble,
    of: OfInterest | Sequence[OfInterest],
    by: str | Sequence[str],
    *,
    method: str | Method | None = None,
    h: float | None = None,
    t1: float | None = None,
    save: SaveAt | None = None,
    dtype: str | None = None,
    smooth: bool = False,
    seed: int | None = None,
    threads: int | None = None,
    width: int | None = None,
    executor: Any = "threads",
    scheduler: str | None = None,
    progress: Callable[[float], None] | bool | None = None,
) -> Derivatives:
    """Compute derivatives of a run's outputs with respect to numbers of the scene, each with an error estimate.

    Each member runs together with copies that have the same noise. In a copy, one number is changed by one of several
    increments. The differences are extrapolated, and the increments that agree best are used. A quantity that jumps or
    changes in steps has no derivative: the answer gives the reason, and its entries are NaN.

    Args:
        fleet: A Scene, whose [ensemble] is ignored; or an Ensemble, for derivatives of each member.
        of: One or several quantities, as in `lw.prepare`: "position[2]", "max(depth)", "end_time floor",
            lw.metrics.ITAE("depth"), a function of a Result.
        by: Names of the numbers, as in `lw.prepare`: "vehicle.mass", "start.position[2]", "depth_pid.kp", ...
        method: As in `lw.solve`; the scene's method by default.
        h: Step [s]; the scene's step by default.
        t1: End of the run [s]; the scene's duration by default.
        save: Samples to keep; by default those that the quantities need.
        dtype: "float64", "float32" or "float32_compensated". In float32 derivatives have few digits.
        smooth: True turns off the rounding of sensor readings to their quantum. Default False.
        seed: Seed of the noise, and of the members if they are drawn, a whole number from 0; by default the ensemble's.
        threads: Number of threads; by default all cores, or one for short runs.
        width: Vehicles per packet; by default chosen for the CPU.
        executor: "threads" (default), "processes" or "dask", or an object that runs blocks.
        scheduler: Address of Dask's scheduler.
        progress: True shows a bar or lines, as in lw.solve; a function is called with the completed fraction of the
            work, in [0, 1]. None, the default: nothing is shown.

    Returns:
        Values, derivatives with their errors, and the reasons for undefined derivatives.

    Raises:
        SceneError: If arguments are faulty; one message lists all faults.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> slopes = lw.derivatives(scene, of="depth", by=["vehicle.buoyancy", "start.velocity[0]"], h=0.1, t1=2.0)
        >>> slopes.jacobian.shape, bool((slopes.error < 1e-7 * abs(slopes.jacobian)).all())
        ((1, 2), True)
    """
    settings = dict(
        method=method, h=h, t1=t1, save=save, dtype=dtype, threads=threads, width=width, executor=executor,
        scheduler=scheduler,
    )  # fmt: skip
    question = _checked(fleet, of, by, smooth, seed)
    return Answering(question, settings, callback(progress) or (lambda share: None)).answer()


def _checked(fleet: Any, of: Any, by: Any, smooth: Any, seed: Any) -> SlopesQuestion:
    """Read the question. Raises SceneError with all faults of the arguments."""
    scene, faults = scene_of(fleet), Faults()
    interests: tuple[OfResult, ...] = ()
    with faults.including():
        interests = quantities(of)
    labels = [each.label for each in interests]
    for label in sorted({label for label in labels if labels.count(label) > 1}):
        faults.add("of", label, "is named twice", "name each quantity once, and give functions names of their own")
    names, numbers = names_of(faults, by, "by"), list[Target]()
    for name in names:
        if len(targets(name)) > 1:
            faults.add("by", name, "names several numbers", "name each by itself")
            continue
        with faults.including():
            numbers.append(single_number(scene, name, "by")[0])
    with faults.including():
        flag("smooth", smooth)
    alone = not isinstance(fleet, Ensemble)
    members = Ensemble(scene, 1) if alone else fleet
    if members.final is not None:
        faults.add("fleet", "...", "goes on from another run", "give members that start at t = 0")
    settings = scene.ensemble_settings
    with faults.including():
        if alone:
            members = Ensemble(scene, 1, (settings.seed if settings else 0) if seed is None else seed)
        elif seed is not None:
            members = fleet.with_seed(seed)
    faults.raise_if_any()
    rounding = undefined.quanta(scene, members.parameters(0, members.members))
    if smooth:
        smoothed = scene.with_numbers({name: 0.0 * scene.parameters()[name] for name in rounding})
        return SlopesQuestion(members, smoothed, interests, names, tuple(numbers), alone, smoothed=tuple(rounding))
    return SlopesQuestion(members, scene, interests, names, tuple(numbers), alone, rounding=rounding)
