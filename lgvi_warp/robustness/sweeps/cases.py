# SPDX-License-Identifier: Apache-2.0
"""Cases of a sweep, and its grid. A case is the sweep's scene with other numbers, other parts or another vehicle."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, closest, refusal
from lgvi_warp.control.base import SECTIONS
from lgvi_warp.physics import terms
from lgvi_warp.physics.vehicle import Vehicle
from lgvi_warp.scene import variations
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.names import by_key
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.start import NAMES

# Lists of a scene that a case may replace, beside those of the controller.
LISTS = ("terms", "events", "controller")
# What may be said of how the probability of a rare failure is found.
RARE = ("relative_error", "cheaper", "most")


@dataclass(frozen=True)
class Case:
    """Case of a sweep: one design, described by its changes to the sweep's scene.

    Args:
        name: name of the case.
        set: numbers by name that replace the scene's numbers: {"heading_pid.kp": 2.0, "drag.quadratic[0]": 3.0}. If
            such a number varies in the fleet, it is constant in this case.
        replace: lists that replace the scene's lists: {"laws": [...]} or another list of the controller, "events", the
            whole "controller", or "terms". An entry of "terms" replaces the term with the same name, or is added.
        vehicle: another vehicle, lw.Vehicle(...), or some of its numbers by field; None (default): the scene's vehicle.
        scene: another scene, to which the other changes are applied; None (default): the sweep's scene.
        rare: True: lw.rare_event estimates the probability, even if very small, that a member does not pass. A dict
            does the same and gives some arguments of lw.rare_event, {"relative_error": 0.2, "most": 200_000}. None
            (default): as the argument `rare` of the sweep.

    Raises:
        SceneError: an argument has the wrong type.

    Examples:
        >>> import lgvi_warp as lw
        >>> case = lw.studies.Case("light", set={"vehicle.buoyancy": 310.0})
        >>> case.of(lw.Scene.named("remus_100")).vehicle.buoyancy
        310.0
    """

    name: str
    set: Mapping[str, Any] = field(default_factory=dict)
    replace: Mapping[str, Any] = field(default_factory=dict)
    vehicle: Any = None
    scene: Scene | None = None
    rare: Any = None

    def __post_init__(self) -> None:
        faults = Faults(f"case {self.name!r}: " if isinstance(self.name, str) else "cases: ")
        if not isinstance(self.name, str) or not self.name:
            faults.add("name", self.name, "is not a name", 'give name = "pid"')
        for key in ("set", "replace"):
            if not isinstance(getattr(self, key), Mapping):
                example = 'set = { "heading_pid.kp" = 2.0 }' if key == "set" else "replace = { laws = [...] }"
                faults.add(key, getattr(self, key), "is not a table", f"write {example}")
        if self.scene is not None and not isinstance(self.scene, Scene):
            faults.add("scene", self.scene, "is not a Scene", "give lw.Scene.load(path)")
        check_rare(faults, self.rare)
        faults.raise_if_any()

    def of(self, scene: Scene) -> Scene:
        """Return the scene of this case.

        Args:
            scene: the sweep's scene.

        Returns:
            The case's own scene if it has one, otherwise the sweep's, with the vehicle, lists and numbers of the case.

        Raises:
            SceneError: the case does not fit the scene.
        """
        scene = scene if self.scene is None else self.scene
        if isinstance(self.vehicle, Mapping):
            scene = scene.with_numbers({f"vehicle.{name}": value for name, value in self.vehicle.items()})
        elif self.vehicle is not None:
            if not isinstance(self.vehicle, Vehicle):
                raise refusal("vehicle", self.vehicle, "is not a Vehicle", "give lw.Vehicle(...), or numbers of it")
            scene = replace(scene, vehicle=self.vehicle)
        return with_lists(scene, self.replace).with_numbers(self.set)


def cases_of(tables: Any) -> tuple[Case, ...]:
    """Read the cases of a sweep; None means the scene itself.

    tables: `Case` and tables with its arguments; or a mapping of names to these tables, or to the numbers that a case sets.
    """
    if tables is None:
        return (Case("scene"),)
    faults, cases = Faults(), list[Case]()
    entries: list[Any]
    if isinstance(tables, Mapping):
        arguments = set(Case.__dataclass_fields__) - {"name"}
        entries = [{"name": name, **(table if isinstance(table, Mapping) and table.keys() <= arguments else {"set": table})}
                   for name, table in tables.items()]  # fmt: skip
    else:
        entries = items_of(tables) or []
    if not entries:
        example = 'give [{"name": "pid"}, {"name": "stiff", "set": {"heading_pid.kp": 2.0}}]'
        raise refusal("cases", tables, "is not a list of cases", example)
    for i, entry in enumerate(entries):
        if isinstance(entry, Case):
            cases.append(entry)
            continue
        if not isinstance(entry, Mapping) or "name" not in entry:
            faults.add(f"cases[{i}]", entry, "has no name", 'write [[cases]] and name = "pid" below')
            continue
        faults.keys(f"cases[{i}]", entry, Case.__dataclass_fields__)
        with faults.including():
            cases.append(Case(**{key: value for key, value in entry.items() if key in Case.__dataclass_fields__}))
    names = [case.name for case in cases]
    for name in sorted({name for name in names if names.count(name) > 1}):
        faults.add("cases", name, f"is the name of {names.count(name)} cases", "give each a name of its own")
    faults.raise_if_any()
    return tuple(cases)


def check_rare(faults: Faults, rare: Any) -> None:
    """Add errors in the argument `rare` to the faults."""
    if isinstance(rare, Mapping):
        faults.keys("rare", rare, RARE)
        if not rare:
            faults.add("rare", "{}", "says nothing", "write rare = true")
    elif rare is not None and not isinstance(rare, bool):
        faults.add("rare", rare, "is neither true nor a table", "write rare = true, or rare = { relative_error = 0.2 }")


def grid_of(grid: Any) -> dict[str, list[Any]]:
    """Axes of a sweep's grid, name of a number -> its values; None means no axes."""
    if grid is None:
        return {}
    if not isinstance(grid, Mapping):
        raise refusal("grid", grid, "is not a table", 'write [grid] and "controller.delay" = [0.0, 0.1] below')
    faults = Faults("grid.")
    axes = {name: items_of(values) or [] for name, values in grid.items()}
    for name, values in axes.items():
        if not values:
            faults.add(f'"{name}"', grid[name], "is not a list of values", "give [0.0, 0.1, 0.2]")
        elif any(value in values[:i] for i, value in enumerate(values)):
            faults.add(f'"{name}"', values, "has a value twice", "keep one of them")
    faults.raise_if_any()
    return axes


def points_of(axes: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    """All combinations of the values of a grid, the last axis fastest; without axes, one empty combination."""
    return [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]


def with_lists(scene: Scene, lists: Mapping[str, Any]) -> Scene:
    """The scene with other parts. A term replaces the term of the same name, or is added if there is no such term."""
    known = (*SECTIONS, *LISTS)
    faults = Faults("replace.")
    for name in lists:
        if name not in known:
            faults.add(name, "...", "is not a list of a scene", closest(name, known))
        elif name in SECTIONS and scene.controller is None and "controller" not in lists:
            faults.add(name, "...", "is a list of a controller, which this scene has not", "give the whole controller")
    faults.raise_if_any()
    of_scene = {name: value for name, value in lists.items() if name in LISTS}
    if "terms" in of_scene:
        replacing = terms.from_list(of_scene["terms"])
        keys = {term.key for term in replacing}
        of_scene["terms"] = (*(term for term in scene.terms if term.key not in keys), *replacing)
    if of_scene:
        scene = replace(scene, **of_scene)
    parts = {name: value for name, value in lists.items() if name in SECTIONS}
    return replace(scene, controller=replace(scene.controller, **parts)) if parts else scene


def known_names(scene: Scene) -> set[str]:
    """Names of all quantities that may vary in a scene."""
    return {*scene.parameters(), *(f"start.{name}" for name in NAMES)}


def ensemble_of(
    scene: Scene, numbers: Mapping[str, Any], vary: Mapping[Any, Any], like: Ensemble
) -> tuple[Ensemble, list[str]]:
    """The members of a case, and names of quantities that do not vary: the case sets them or does not have them."""
    known = known_names(scene)
    fixed = {target.name for name in numbers for target in variations.targets(by_key(scene, name))}
    dropped = [name for name in vary if any(t.name in fixed or t.name not in known for t in variations.targets(name))]
    if dropped and like.sampling.kind != "random":
        why = f"does not vary here, and with sampling {like.sampling.kind!r} the other numbers would be others too"
        raise refusal("vary", ", ".join(map(str, dropped)), why, 'use sampling = "random", or leave it out of vary')
    kept = {name: distribution for name, distribution in vary.items() if name not in dropped}
    return Ensemble(scene, like.members, like.seed, kept, like.sampling), list(map(str, dropped))
