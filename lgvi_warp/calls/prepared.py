# SPDX-License-Identifier: Apache-2.0
"""`prepare`: a run that is called many times with different numbers, at little more than the cost of its kernel."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lgvi_warp.calls.noise import DRAWN, GIVEN, NoiseOfCalls, checked_indices
from lgvi_warp.calls.runner import PATHS_AT_ONCE, Runner, outputs, samples_for, statistics_for, values_of
from lgvi_warp.common.arguments import flag
from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.common.labelled import columns_by_name, is_labelled
from lgvi_warp.common.near import near_names
from lgvi_warp.common.progress import callback, shows_progress
from lgvi_warp.common.sentences import capital
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.physics.given_draws import GivenDraws, NoiseDraws
from lgvi_warp.results.quantities import OfInterest, OfResult, quantities
from lgvi_warp.runs.request import ensemble_of, scene_of
from lgvi_warp.sampling.designs.designs import salib_problem
from lgvi_warp.sampling.designs.levels import UnitCubePoints
from lgvi_warp.sampling.designs.table import Table
from lgvi_warp.sampling.final import Final
from lgvi_warp.scene import variations
from lgvi_warp.scene.columns import as_given, columns_of, names_of, stacked, whole_columns
from lgvi_warp.scene.draw_layout import draw_layout
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.names import numbers_of, single_number
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.settings import EnsembleSettings


class FailedMembers(SceneError):  # noqa: N818  (what happened, and no fault of the scene)
    """Raised if members failed and the quantities cannot be computed from the remaining members."""


class Prepared:
    """A run made by `prepare` that can be called many times. By default row i of the input X has the noise of member i.

    Args:
        fleet: members that a call without X runs.
        table: ensemble in which the numbers X of a call replace columns; or a text on why calls cannot take X.
        names: names of the columns of X.
        of: quantities of interest; empty if calls return whole results.
        runner: object that prepares and runs the calls.
        levels: for each name, its column in the unit cube if X holds probability levels; None if X holds values.
        refuse: whether a failed member is an error; otherwise its quantities are NaN.
        common_noise: whether all members have the same noise.
        noise: layout of the random draws of a call, and their source.
        made_of: arguments of `prepare`, by position and by name, from which a pickled run is prepared again.

    Attributes:
        names: names of the columns of X (d,).
        common_noise: whether all members have the same noise.
        noise: layout of the random draws of a call, and their source.
        draws: random draws of forces and sensors in a call.

    Methods:
        states: run members from given states.
        numbers: numbers of members as an array.
    """

    def __init__(
        self,
        fleet: Ensemble,
        table: Ensemble | str,
        names: tuple[str, ...],
        of: tuple[OfResult, ...],
        runner: Runner,
        levels: Sequence[int] | None,
        refuse: bool,
        common_noise: bool,
        noise: NoiseOfCalls,
        made_of: tuple[Any, ...],
    ):
        self._arguments = made_of
        self._fleet, self._table, self.names, self._of, self._runner = fleet, table, names, of, runner
        self._levels, self._refuse, self.common_noise, self.noise = levels, refuse, common_noise, noise

    @property
    def draws(self) -> tuple[NoiseDraws, ...]:
        """Streams of the standard normal draws in a call, in the order of the columns of xi; empty without noise."""
        return self.noise.layout.draws

    @shows_progress
    def __call__(
        self,
        X: Any = None,
        xi: Any = None,
        *,
        seed: int | None = None,
        members: int | None = None,
        indices: Any = None,
        progress: Callable[[float], None] | bool | None = None,
    ) -> Any:
        """Run members with the numbers of X from t = 0. By default row i of X has the noise of member i in every call.

        Some algorithms keep or move rows between calls (Markov chains, subset simulation, optimisers). With noise, they
        must select the noise of each row. The same `indices` and `seed` give the same noise; other values give other
        noise.

        X: (n, d), columns in the order of `names`; or columns by name, in any order: a mapping, a data frame, a
            structured array, an xarray Dataset. A name may also stand for a whole vector, "current.velocity": (n, 3).
            Without X the members are drawn from the distributions.
        xi: (n, m), float32 or float64, only for a run prepared with draws="given": standard normals that forces and
            sensors use instead of drawing them. `draws` lists the columns; lw.uq.draws_of(run, indices) returns the
            default draws.
        seed: seed of the noise of forces and sensors, and of the drawn members, a whole number from 0; default None:
            the seed of the ensemble.
        indices: (n,), only with X: whole numbers from 0. Each row has the noise of the member with this index in an
            ensemble with this seed; rows with the same index have the same noise. Default None: 0 to n - 1.
        progress: True shows a bar or lines, as in lw.solve; a function is called with the finished fraction of the
            work, in [0, 1].
        Returns: The quantities: (n,) for a single number, (n, m) for several numbers; a `Result` if `of` is None.
        """
        if X is not None and members is not None:
            raise refusal("members", members, "is given beside X, whose rows are the members", "leave out one of them")
        if X is None and indices is not None:
            remedy = "give X, or draw the members of a seed: run(seed=..., members=...)"
            raise refusal("indices", indices, "name the noise of the rows of X, and there is no X", remedy)
        fleet = self._drawn(seed, members) if X is None else self._with_noise(self._members(X), seed, indices)
        return self._answer(self._given(fleet, xi, {"seed": seed, "indices": indices}), callback(progress))

    def states(
        self,
        position: Any,
        attitude: Any = None,
        velocity: Any = None,
        angular_velocity: Any = None,
        parameters: Any = None,
        *,
        xi: Any = None,
        indices: Any = None,
        seed: int | None = None,
        t0: float | None = None,
    ) -> Any:
        """Run members from given states, or continue from the end of another run, for the duration of the prepared run.

        By default row i of the states has the noise of member i in every call. A continued run also continues its
        noise. Successive calls, each from the last `result.final`, together give the same bits as one long run.

        Args:
            position: (n, 3) [m], inertial axes; or `result.final` of another run, which replaces all four arrays.
            attitude: (n, 3, 3), body to inertial axes.
            velocity: (n, 3) [m/s], body axes.
            angular_velocity: (n, 3) [rad/s], body axes.
            parameters: arrays (n, ...) by name, as in `Ensemble.from_states`. None, the default, uses the numbers of
                the scene, or of `result.final`.
            xi: standard normal numbers, as in a call of the run.
            indices: (n,), whole numbers from 0 that select the noise of each member, such as its index in another
                ensemble; members with the same index have the same noise. By default 0 to n - 1, or the indices of
                `result.final`.
            seed: the seed of the noise, a whole number from 0; by default 0, or the seed of `result.final`.
            t0: time of the states [s], a whole number of steps. Waves, schedules and noise start at this time; by
                default 0, or the time of `result.final`. Sample times of the prepared run count from t0.

        Returns:
            The quantities, or a `Result`, as from a call of the run.

        Raises:
            SceneError: if an array has a wrong shape or unphysical values, or the seed is not a whole number. States that
                are not finite raise no error: their members fail.
            FailedMembers: if members failed, unless failed="nan".
        """
        scene, final = self._fleet.scene, position if isinstance(position, Final) else None
        if final is None:
            fleet = Ensemble.from_states(scene, position, attitude, velocity, angular_velocity, parameters)
            fleet.seed = int(EnsembleSettings(fleet.members, 0 if seed is None else seed).seed)
        else:
            others = {"attitude": attitude, "velocity": velocity, "angular_velocity": angular_velocity}
            for name in (name for name, values in others.items() if values is not None):
                problem = "is given beside the end of a run, which has it"
                raise refusal(
                    name, "...", problem, "give parameters=, indices=, seed= or t0= by name, or final.changed(...)"
                )
            fleet = members_at(scene, final, parameters)
            fleet.seed = final.seed if seed is None else int(EnsembleSettings(fleet.members, seed).seed)
            fleet.indices = final.indices
        if t0 is not None:
            faults = Faults()
            fleet.start_time = faults.number("t0", t0, "s", 0.0) or 0.0
            faults.raise_if_any()
        fleet = self._with_noise(fleet, None, indices)
        return self._answer(self._given(fleet, xi, {"seed": seed, "indices": indices}), None)

    def __reduce__(self) -> tuple[Any, ...]:
        arguments, settings = self._arguments
        return _prepared_again, (arguments, settings)

    def _drawn(self, seed: int | None, members: int | None) -> Ensemble:
        fleet = self._fleet
        if seed is None and members is None:
            return fleet
        return fleet.with_seed(fleet.seed if seed is None else seed, members)

    def _with_noise(self, fleet: Ensemble, seed: int | None, indices: Any) -> Ensemble:
        """Set the seed and the indices of the noise of a new ensemble; None leaves the seed or the indices unchanged."""
        if seed is not None:
            fleet.seed = int(EnsembleSettings(fleet.members, seed).seed)
        if indices is None:
            return fleet
        keys = checked_indices(indices, fleet.members)
        if self.common_noise:
            problem = "are given, where common_noise=True gives all members the noise of member 0"
            raise refusal("indices", indices, problem, "leave them out, or prepare the run without common_noise")
        fleet.indices = keys
        return fleet

    def _given(self, fleet: Ensemble, xi: Any, keys: dict[str, Any]) -> Ensemble:
        """Attach the standard normals of a call to the members; without them, the members' counters draw the noise."""
        given = self.noise.of_call(xi, fleet.members, keys)
        if given is None:
            return fleet
        if fleet.start_time or fleet.final is not None:
            problem = "is not where members start whose draws are given: these are counted from t = 0"
            raise refusal("t0", fleet.start_time, problem, "prepare the run without draws='given'")
        more = fleet.varied_names - self.noise.varied
        if more and draw_layout(fleet.scene, fleet.varied_names, self.noise.grid) != given.layout:
            remedy = "name what varies as the run is prepared: prepare(scene, vary=[...])"
            named = ", ".join(sorted(name for name in more if not name.startswith("start.")))
            raise refusal("parameters", named, "make something draw that run.draws does not list", remedy)
        return fleet.with_given(given)

    def _members(self, X: Any) -> Ensemble:
        """Make the ensemble whose members have the numbers of X."""
        if isinstance(self._table, str):
            raise SceneError([f"X: {self._table}"])
        numbers = self.numbers(X)
        if self._levels is None:
            return self._table.with_columns(dict(zip(self.names, numbers.T, strict=True)))
        inside = np.empty_like(numbers)
        inside[:, self._levels] = np.clip(numbers, 2.0**-53, 1.0 - 2.0**-53)
        return Ensemble(self._fleet.scene, None, self._fleet.seed, self._fleet.vary, UnitCubePoints(inside))

    def numbers(self, X: Any) -> np.ndarray:
        """Convert X to an array of the members' numbers.

        Args:
            X: numbers of the members, as in a call of the run.

        Returns:
            (n, d), columns in the order of the names.

        Raises:
            SceneError: if a label is missing, unknown or given twice, or an entry is not a real number.
        """
        faults, names = Faults(), self.names
        shape = f"give an array of shape (n, {len(names)}), columns {', '.join(names)}"
        if is_labelled(X):
            known = numbers_of(self._fleet.scene)
            columns = whole_columns(faults, names, known, columns_by_name(faults, "X", X))
            array = stacked(faults, "X", names, columns) if columns else None
        else:
            array = faults.real("X", X, shape)
        if array is not None and (array.ndim != 2 or array.shape[1] != len(names) or not len(array)):
            faults.add("X", "...", f"has shape {array.shape}", shape)
        if array is not None and self._levels is not None and not np.all((array >= 0.0) & (array <= 1.0)):
            odd = array[~((array >= 0.0) & (array <= 1.0))][0]
            remedy = "give levels, or leave out levels=True to give the numbers"
            faults.add("X", odd, "is not a level between 0 and 1", remedy)
        faults.raise_if_any()
        assert array is not None
        return array

    def _answer(self, fleet: Ensemble, progress: Callable[[float], None] | None) -> Any:
        if self.common_noise:
            fleet = copy.copy(fleet)
            fleet.indices = np.zeros(fleet.members, dtype=np.int64)
        if not self._of:
            return self._runner.run(fleet, progress, final=replace(self._runner.request, fleet=fleet).keeps_final)
        large = any(each.over_path or each.is_function for each in self._of)
        if large:
            found = self._runner.evaluate(fleet, self._of, PATHS_AT_ONCE, progress, warned=False)
        else:
            samples = self._runner.samples(fleet, progress) if all(each.is_plain for each in self._of) else None
            result, status = samples or (self._runner.run(fleet, progress, warned=False), None)
            status = status if samples else np.asarray(result.status)
            numbers = values_of(result, fleet, self._of)
            values = numbers[0] if len(numbers) == 1 else np.concatenate(numbers, axis=1)
            if (status is None or not status.any()) and np.isfinite(values).all():
                return values[:, 0] if values.shape[1] == 1 else values
            status = np.zeros(len(values), np.uint8) if status is None else status
            found = outputs(self._of, [numbers], [status], {})
        values = found.values
        if self._refuse and found.failed.any():
            raise FailedMembers([found.text('fix the failing members, or take NaN for them: failed="nan"')])
        return values[:, 0] if values.shape[1] == 1 else values


def members_at(scene: Any, final: Final, parameters: Any = None) -> Ensemble:
    """Make members of a scene that start with the final states and the parameters of another run.

    parameters: arrays (n, ...) by name that replace the parameters of that run; entries of a vector by their own names.
    """
    n, of_scene, had, faults = final.members, scene.parameters(), dict(final.parameters), Faults()
    for name in (name for name, value in of_scene.items() if name in had and had[name].shape[1:] != np.shape(value)):
        problem = f"has shape {had[name].shape[1:]} of each member, and {np.shape(of_scene[name])} in this scene"
        faults.add(f"final.parameters.{name}", had[name], problem, "go on in the scene of the run before")
    faults.raise_if_any()
    numbers = {name: np.array(np.broadcast_to(had[name], (n, *np.shape(value)))) for name, value in of_scene.items()
               if name in had and not np.array_equal(np.broadcast_to(value, had[name].shape), had[name])}  # fmt: skip
    columns = {} if parameters is None else columns_by_name(faults, "parameters", parameters) or {}
    faults.raise_if_any()
    for name, column in columns.items():
        (target,) = variations.targets(name)
        if target.index is not None and target.name in numbers:
            variations.put(numbers, target, np.asarray(column, dtype=np.float64), into=True)
        else:
            numbers[name] = column
    # Where they go on from has their states, and attitudes that a method let drift from rotations.
    rest, upright = np.zeros((n, 3)), np.broadcast_to(np.eye(3), (n, 3, 3))
    return Ensemble.from_states(scene, rest, upright, rest, rest, numbers or None).going_on(final)


@near_names()
def prepare(
    fleet: Scene | Ensemble,
    vary: Mapping[Any, Any] | Sequence[str] | None = None,
    of: OfInterest | Sequence[OfInterest] | None = None,
    *,
    method: str | Method | None = None,
    h: float | None = None,
    t1: float | None = None,
    save: SaveAt | None = None,
    dtype: str | None = None,
    statistics: Sequence[Any] = (),
    levels: bool = False,
    failed: str = "refuse",
    common_noise: bool = False,
    draws: str = DRAWN,
    threads: int | None = None,
    width: int | None = None,
    checks: str | None = None,
    on_failure: str | None = None,
    device: str | None = None,
    executor: Any = "threads",
    scheduler: str | None = None,
) -> Prepared:
    """Prepare a run that is called many times with different numbers X. By default row i of X has the noise of member i.

    Checks, compilation and everything else that does not depend on `vary` are done once. A call then takes little longer
    than its kernel, and its results are bit-identical to those of `solve`. The prepared run can be pickled and called
    from threads.

    Noise of forces and sensors is frozen: in every call row i of X has the noise that `solve` gives to member i with
    the ensemble's seed. Algorithms that move rows between calls, such as Markov chains, select the noise of each row by
    run(X, seed=..., indices=...).

        run = lw.prepare(scene, ["vehicle.mass", "start.position[2]"], of="max(depth)", h=0.01, t1=60.0)
        depths = run(X)                                    # X (n, 2), depths (n,)

    Args:
        fleet: A Scene or an Ensemble. If `vary` is None, the ensemble (a Scene: [ensemble]) names the varied numbers.
        vary: Names of the numbers that vary, ["vehicle.mass", "start.position[2]"], or a mapping of names to
            distributions.
        of: One or several quantities of interest: "position[2]", "max(depth)", a Quantity, a function of a Result,
            "outcome floor", or a metric as in `lw.sweep` ("iae depth", lw.metrics.ITAE("depth")). None, the
            default: calls return whole results.
        method: As in `lw.solve`. If omitted, it and h, t1, dtype, width, checks, on_failure, device, threads, executor
            and scheduler are taken from the scene's [run]. A default method is chosen once, for `fleet`.
        h: Step [s].
        t1: End of the run [s].
        save: Samples to keep, as in `lw.solve`. With `of`, by default the samples that the quantities need.
        dtype: "float64", "float32" or "float32_compensated".
        statistics: Statistics gathered over the members of each call, in result.statistics; by default none.
        levels: Whether X holds probability levels in (0, 1), which the distributions convert to values. False, the
            default: X holds the values themselves. Joint distributions need levels.
        failed: "refuse", the default, raises an error if members fail or quantities are not finite (end_time without that
            end); "nan" sets all quantities of a failed member to NaN, and leaves the others as they are. Only with `of`.
        common_noise: Whether all members have the same noise of forces and sensors; False by default.
        draws: "drawn", the default: the run draws the noise of forces and sensors from the seed. "given": each call passes
            standard normal numbers, run(X, xi); the attribute `draws` of the prepared run lists the columns of xi.
        threads: Number of threads; by default one per core. A short run has one thread by default (fewer than 2,000
            members, and fewer than a million steps summed over the members).
        width: Number of vehicles in a packet; by default chosen for the CPU.
        checks: "safe", "all" or "none", as in `lw.solve`.
        on_failure: "freeze", "raise" or "substep", as in `lw.solve`.
        device: "cpu", the only device.
        executor: "threads" (default), "processes" or "dask", or an object that runs blocks.
        scheduler: Address of Dask's scheduler.

    Returns:
        The prepared run, a `Prepared` that is called as run(X); its `names` are the names of the columns of X.

    Raises:
        SceneError: If arguments are at fault; the message names every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> run = lw.prepare(scene, vary=["vehicle.buoyancy"], of="depth", h=0.1, t1=2.0)
        >>> run([[300.0], [306.0]]).shape
        (2,)
    """
    faults = Faults()
    scene = scene_of(fleet)
    interests: tuple[OfResult, ...] = ()
    if of is not None:
        with faults.including():
            interests = quantities(of)
    faults.choice("failed", failed, ("refuse", "nan"))
    faults.choice("draws", draws, (DRAWN, GIVEN))
    if isinstance(draws, str) and draws == GIVEN and common_noise is True:
        faults.add(
            "common_noise", True, 'says whose noise each row has, where draws="given" takes it from xi', "leave it out"
        )
    distributions = isinstance(vary, Mapping)
    listed = names_of(faults, vary) if vary is not None and not distributions else ()
    levels = flag("levels", levels)
    if levels and listed:
        faults.add("vary", vary, "has no distributions, which levels=True needs", "map names to distributions")
    faults.raise_if_any()
    if vary is None:
        full = ensemble_of(fleet)
    elif distributions:
        full = Ensemble(scene, 1, 0, vary)  # type: ignore[arg-type]
    else:
        full = Ensemble(scene, 1)
    names, table, columns = _columns(full, listed, levels)
    gathered = statistics_for(scene, interests)
    save = samples_for(scene, interests, save)
    settings = dict(
        method=method, h=h, t1=t1, save=save, dtype=dtype, width=width, checks=checks, on_failure=on_failure,
        device=device,
    )  # fmt: skip
    first = full if isinstance(table, str) else table
    how = dict(threads=threads, executor=executor, scheduler=scheduler)
    runner = Runner(first, [*statistics, *gathered] if gathered else statistics, **settings, **how)
    known = (
        settings
        | how
        | dict(statistics=statistics, levels=levels, failed=failed, common_noise=common_noise, draws=draws)
    )
    made_of = (fleet, vary, of), known
    grid, varied = runner.request.grid(), frozenset(first.varied_names)
    layout = draw_layout(scene, varied, grid)
    if draws == GIVEN:
        # In place of what calls will give: what all of them share is settled here.
        first = first.with_given(GivenDraws(layout, np.broadcast_to(0.0, (1, layout.count))))
    plan = runner.plan(first)
    first.select(0, 1)  # which keeps what all members share
    noise = NoiseOfCalls(layout, draws == GIVEN, full.seed, full.members, plan, varied, grid)
    return Prepared(full, table, names, interests, runner, columns, failed == "refuse", common_noise, noise, made_of)


def _prepared_again(arguments: tuple[Any, ...], settings: dict[str, Any]) -> Prepared:
    return prepare(*arguments, **settings)


def _columns(
    full: Ensemble, listed: tuple[str, ...], levels: bool
) -> tuple[tuple[str, ...], Ensemble | str, list[int] | None]:
    """Return (names of the columns of X; an ensemble with them, or a text why there is no X; columns of the unit cube)."""
    scene, names, cube_columns = full.scene, listed, None
    of_sampling = [*full.sampling.own_values(), *full.sampling.distributions()]
    if of_sampling:
        dropped = ", ".join(of_sampling[:4])
        return (
            (),
            f"would drop {dropped}, to which the ensemble's {full.sampling.kind} gives values; name what varies",
            None,
        )
    if not listed and full.vary:
        described = as_given(full)
        joint = [variation for variation in described if variation.distribution.joint]
        if joint and not levels:
            remedy = "give levels=True, or let members be drawn: run(seed=...)"
            return (
                (),
                f'vary."{joint[0].key}" is a joint distribution, whose values are not single numbers. {capital(remedy)}',
                None,
            )
        cube_columns = [column for variation in described for column in columns_of(full.space, variation.key)]
        cube = salib_problem(full.space)["names"]
        names = tuple(cube[column] for column in cube_columns)
        if levels:
            return names, full, cube_columns
    if not names:
        return (), "has no columns, since nothing varies; name what varies: prepare(scene, vary=[...])", None
    faults, values, taken = Faults(), {}, []
    for name in names:
        with faults.including():
            target, number = single_number(scene, name)
            values[target.label] = np.array([number])
            taken.append((name, (target,)))
    variations.clashes(faults, taken)
    faults.raise_if_any()
    return tuple(values), Ensemble(scene, None, full.seed, None, Table(values=values)), None
