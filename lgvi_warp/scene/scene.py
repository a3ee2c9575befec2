# SPDX-License-Identifier: Apache-2.0
"""A scene: one vehicle, its environment, the terms that act on it, and its initial state."""

from __future__ import annotations

import functools
import inspect
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np

from lgvi_warp.common import summaries
from lgvi_warp.common.arguments import path_of
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.names import alike, folded
from lgvi_warp.common.reading import file_text
from lgvi_warp.common.summaries import Summarized
from lgvi_warp.physics import terms
from lgvi_warp.physics.fields import TABLE
from lgvi_warp.physics.terms import events
from lgvi_warp.physics.terms.surface_level import below
from lgvi_warp.physics.vehicle import UNITS, Vehicle
from lgvi_warp.sampling.distributions.named import from_dict as distribution_from_dict
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.file import (
    tables_of_text,
    with_named_vehicle,
    with_origin_of_floors,
    with_times_of_data,
)
from lgvi_warp.scene.settings import EnsembleSettings, RunSettings
from lgvi_warp.scene.start import Environment, Start
from lgvi_warp.scene.variations import check_names

# Sections of a scene that are one object each.
RUN_REMEDY = (
    'leave it out and give lw.solve(scene, h=..., t1=..., ...) its settings, or lw.Scene.from_dict a table "run"'
)
KINDS = {"vehicle": Vehicle, "environment": Environment, "start": Start, "run": RunSettings}


@dataclass(frozen=True, eq=False, repr=False)
class Scene(Summarized):
    """One vehicle, its environment, the terms that act on it, and its initial state.

    Weight, buoyancy and restoring moment follow from the vehicle; they are not listed as terms.

    Args:
        vehicle: The body, as lw.Vehicle(...).
        environment: Gravity and water, as lw.Environment(...); by default the standard values.
        terms: Further forces, such as lw.terms.Drag(...), or tables as in a scene file.
        start: The state at t = 0, as lw.Start(...); by default at rest at the origin.
        controller: The controller, as lw.Controller(...) or a table as in a scene file; by default there is none.
        run: Settings of the run, the section [run] of a scene file.
        ensemble_settings: Members and their variations, the section [ensemble] of a scene file; None for one vehicle.
        events: Conditions that stop a member, such as lw.events.Surface(), or tables as in a scene file.

    Methods:
        load: Read a scene file, or a scene that comes with the package ("example:paper").
        named: Scene of a vehicle that comes with the package.
        from_dict: Scene from tables in the form of a scene file.
        to_dict: Tables in the form of a scene file.
        parameters: Every number that may vary between members.
        with_numbers: The scene with other numbers.

    Raises:
        SceneError: If an argument is invalid; the message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", events=[lw.events.Floor(depth=40.0)])
        >>> heavier = scene.with_numbers({"vehicle.weight": 310.0})
        >>> scene.vehicle.weight, heavier.vehicle.weight
        (299.0, 310.0)
    """

    vehicle: Vehicle
    environment: Environment = field(default_factory=Environment)
    terms: Sequence[Any] = ()
    start: Start = field(default_factory=Start)
    controller: Any = None
    run: RunSettings = field(default_factory=RunSettings)
    ensemble_settings: EnsembleSettings | None = None
    events: Sequence[Any] = ()
    ensemble_is_checked: bool = field(default=False, init=False, repr=False)
    # The file that it was read from: its name, its text and what replaced keys of it; a scene that was changed has none.
    source: Mapping[str, Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        faults = Faults()
        with faults.including():
            object.__setattr__(self, "terms", terms.from_list(self.terms))
        with faults.including():
            object.__setattr__(self, "events", events.from_list(self.events))
        if self.controller is not None:
            with faults.including():
                # A scene without a controller loads none of its parts.
                from lgvi_warp.control.controller import from_table

                object.__setattr__(self, "controller", from_table(self.controller))
        if not faults:
            object.__setattr__(self, "events", self._with_own_events())
            self._check_names(faults)
        sound = not faults
        if isinstance(self.environment, Environment) and isinstance(self.start, Start):
            self._locate(faults)
            sound = not faults
        for name, kind in KINDS.items():
            if not isinstance(getattr(self, name), kind):
                # Settings of a run have no public class: they are arguments of solve, or a table of a scene file.
                remedy = RUN_REMEDY if name == "run" else f"give lw.{kind.__name__}(...)"
                faults.add(name, getattr(self, name), f"is not of type {kind.__name__}", remedy)
        if sound and isinstance(self.vehicle, Vehicle) and isinstance(self.environment, Environment):
            with faults.including():
                self._connect()
        faults.raise_if_any()

    def summary_rows(self) -> tuple[str, summaries.Rows]:
        """Rows of the summary: numbers of vehicle and start, and a row for each other section."""
        water, run, settings = self.environment, self.run.to_dict(), self.ensemble_settings
        numbers, start = self.vehicle.parameters().items(), self.start.given().items()
        rows = [("vehicle", self.vehicle.title)] if self.vehicle.title else []
        rows += [(f"vehicle.{name}", summaries.few_digits(value, UNITS[name])) for name, value in numbers]
        rows.append(("environment", f"gravity {water.gravity:g} m/s2, water_density {water.water_density:g} kg/m3"))
        if water.origin is not None:
            rows.append(
                ("origin", f"{water.origin[0]:g}, {water.origin[1]:g} deg" + (f", {water.start}" * bool(water.start)))
            )
        rows += [(f"start.{name}", summaries.few_digits(value, TABLE[name].unit)) for name, value in start]
        rows.append(("terms", summaries.listed(term.key for term in self.terms)))
        if self.controller is not None:
            parts = summaries.listed(part.key for part in self.controller.parts)
            rows.append(("controller", f"every {self.controller.period:g} s: {parts}"))
        rows.append(("events", summaries.listed(event.key for event in self.events)))
        if settings is not None:
            rows.append(("ensemble", f"members {settings.members}, varied: {summaries.listed(settings.vary)}"))
        rows.append(
            ("run", ", ".join(f"{name} {value}" for name, value in run.items() if isinstance(value, str | float)))
        )
        return "Scene", rows

    def _locate(self, faults: Faults) -> None:
        """Convert geodetic coordinates of the start and of waypoints to positions relative to the origin."""
        with faults.including():
            object.__setattr__(self, "start", self.start.located(self.environment))
        if self.controller is not None and not faults:
            with faults.including():
                object.__setattr__(self, "controller", self.controller.located(self.environment.plane))

    def _connect(self) -> None:
        """Connect the terms with the commands of the controller, if there is one, and with their vehicle."""
        bus = None
        if self.controller is not None:
            object.__setattr__(self, "controller", self.controller.wired(self.terms, self._nominal(), self.events))
            bus = self.controller.bus
        object.__setattr__(self, "events", tuple(event.wired(bus) for event in self.events))
        driven = set(bus.commands) if bus else set()
        accounted = any(term.accounts for term in self.terms)
        terms = (term.beside_account(accounted) for term in self.terms)
        wired = tuple(term.driven_by(bus if term.key in driven else None) for term in terms)
        nominal = self._nominal()
        every = (*wired, *self.events)
        object.__setattr__(self, "terms", tuple(below(term.beside(every), wired).of_vehicle(nominal) for term in wired))
        object.__setattr__(self, "events", tuple(below(event.beside(every), wired) for event in self.events))

    def _nominal(self) -> dict[str, np.ndarray]:
        """The numbers of the vehicle and its environment by name."""
        values = {f"vehicle.{name}": value for name, value in self.vehicle.parameters().items()}
        values["environment.gravity"] = np.asarray(float(self.environment.gravity))
        values["environment.water_density"] = np.asarray(float(self.environment.water_density))
        return values

    @property
    def parts(self) -> tuple[Any, ...]:
        """All objects that have numbers: terms, events, and the parts of the controller."""
        parts = () if self.controller is None else (self.controller.delay_part, *self.controller.parts)
        return (*self.terms, *self.events, *parts)

    def _with_own_events(self) -> tuple[Any, ...]:
        """The events, with the present events of terms in place of earlier ones."""
        own = tuple(event for term in self.terms for event in term.own_events)
        return (*(event for event in self.events if not isinstance(event, events.Outside)), *own)

    def _check_names(self, faults: Faults) -> None:
        """Require different names of all terms and events, also on file systems that ignore case."""
        parts = () if self.controller is None else self.controller.parts
        keys = [term.key for term in (*self.terms, *self.events, *parts)]
        counts = Counter(keys)
        for place, word, named, reserved in (
            ("controller", "part", parts, (*terms.RESERVED, "controller")),
            ("events", "event", self.events, terms.RESERVED),
        ):
            for key in sorted({thing.key for thing in named}):
                if folded(key) in reserved:
                    faults.add(place, key, "is the name of a section of the scene", f'write name = "{key}_{word}"')
                elif counts[key] > 1:
                    faults.add(place, key, f"is the name of two {word}s or of a term too",
                               f'give each a name of its own: name = "{key}_2"')  # fmt: skip
        accounted = any(term.accounts for term in self.terms)
        for event in (event for event in self.events if event.looks_at_energy and not accounted):
            problem = "looks at the energy used, which no term accounts"
            faults.add("events", event.key, problem, 'give a term of type "energy_use"')
        for first, second in alike(keys):
            problem = f"is the same folder as {first!r} on file systems that do not tell capitals apart"
            faults.add("terms and events", second, problem, f'give each a name of its own: name = "{second}_2"')

    def note_checked_ensemble(self) -> None:
        """Record that the ensemble of `ensemble_settings` is valid and need not be checked again."""
        object.__setattr__(self, "ensemble_is_checked", True)

    def parameters(self) -> dict[str, np.ndarray]:
        """Return every number that may vary between members, with its value in this scene.

        Returns:
            Values by name: "vehicle.mass", "environment.gravity", "drag.quadratic" (a term's name and its field), ...
            Shapes and units are those of the fields.
        """
        values = self._nominal()
        for term in self.parts:
            values |= {f"{term.key}.{name}": value for name, value in term.parameters().items()}
        return values

    def with_numbers(self, numbers: Mapping[str, Any]) -> Scene:
        """Return the scene with other numbers.

        Args:
            numbers: Values by name. Names are those of `parameters()`, single entries ("drag.quadratic[0]"), numbers of a
                part by its index ("controller.sensors[0].noise"), "start.position" and other fields of the start,
                "controller.period", "run.step" and "run.duration". A new command or schedule replaces a constant command,
                and a new attitude replaces an attitude in any form.

        Returns:
            A new scene.

        Raises:
            SceneError: If a name is unknown, or a value does not fit; the message lists every fault.
        """
        # A scene whose numbers stay as they are loads no controllers.
        from lgvi_warp.scene.numbers import with_numbers

        return with_numbers(self, numbers)

    @classmethod
    def load(cls, path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> Scene:
        """Read a scene from a scene file (TOML).

        Args:
            path: Path of the file, or "example:NAME" for a file that comes with the package (`lgvi-warp example` lists them).
            overrides: Values that replace those of the file, by key ("run.step") or by name as in `with_numbers`
                ("heading_pid.kp", "current.velocity[0]"); by default none.

        Returns:
            The scene.

        Raises:
            SceneError: If the file cannot be read or its content is invalid; the message lists every fault.
        """
        from lgvi_warp.scene.examples import located

        path = located(path)
        text = file_text(path, "scene file")
        scene = loads(text, overrides, os.fspath(path), path_of("path", path).parent)
        changes = {key: value if isinstance(value, str) else repr(value) for key, value in (overrides or {}).items()}
        object.__setattr__(scene, "source", {"file": Path(path).name, "text": text, "changes": changes})
        return scene

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Scene:
        """Build a scene from tables in the form of a scene file, such as those that the importers return.

        Args:
            content: Tables by section name: "vehicle", "environment", "terms", ...; "start" and "run" may also be objects.

        Returns:
            The scene.

        Raises:
            SceneError: If a table is invalid; the message lists every fault.
        """
        return from_dict(content)

    @classmethod
    def named(cls, name: str, **sections: Any) -> Scene:
        """Build a scene of a vehicle that comes with the package; `lw.vehicles.names()` lists their names.

        Args:
            name: Name of the vehicle, such as "remus_100".
            **sections: Sections as in a scene file. Keys of vehicle={...} and environment={...} replace single values.
                An entry of terms=[...] replaces the vehicle's term of the same name or type, or is added to its terms.
                start may also be lw.Start(...), and controller lw.Controller(...).

        Returns:
            The scene, with the vehicle's own terms and the water in which its numbers were determined.

        Raises:
            SceneError: If a name or a section is invalid; the message lists every fault.
        """
        return from_dict({**sections, "vehicle": {**sections.get("vehicle", {}), "name": name}})

    def to_dict(self) -> dict[str, Any]:
        """Return the scene as tables in the form of a scene file.

        Returns:
            Tables by section name. `Scene.from_dict` builds the same scene from them.
        """
        return cast("dict[str, Any]", _copied(self._tables))

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_tables"}

    @functools.cached_property
    def _tables(self) -> dict[str, Any]:
        """The tables of `to_dict`, cached because the numbers of a scene never change."""
        content: dict[str, Any] = {
            "vehicle": self.vehicle.to_dict(),
            "environment": self.environment.to_dict(),
            "start": self.start.to_dict(),
            "run": self.run.to_dict(),
        }
        if self.terms:
            content["terms"] = [term.to_dict() for term in self.terms]
        if self.controller is not None:
            content["controller"] = self.controller.to_dict()
        if self.events:
            content["events"] = [event.to_dict() for event in self.events]
        return content | ({"ensemble": self.ensemble_settings.to_dict()} if self.ensemble_settings else {})


def _copied(content: Any) -> Any:
    """A deep copy of tables and lists of plain values."""
    if type(content) is dict:
        return {key: _copied(value) for key, value in content.items()}
    if type(content) is not list:
        return content
    plain = content and type(content[0]) is float
    return content.copy() if plain else [_copied(value) for value in content]


SECTIONS = ("vehicle", "environment", "start", "ensemble", "run", "terms", "events", "controller", "source")


def loads(
    text: str, overrides: Mapping[str, Any] | None = None, name: str = "scene", folder: Path | None = None
) -> Scene:
    """Build a scene from the text of a scene file (TOML), with some values replaced."""
    content, numbers = tables_of_text(text, overrides, name, folder)
    if not numbers:
        return from_dict(content)
    try:
        return from_dict(content, numbers)
    except SceneError as error:
        faults = dict.fromkeys(error.faults)
        try:
            # Where other values are wrong, names are looked up in the scene as the file has it.
            from_dict(tables_of_text(text, None, name, folder)[0], numbers)
        except SceneError as more:
            faults |= dict.fromkeys(more.faults)
        raise SceneError(faults, error.more) from None


def from_dict(content: Mapping[str, Any], numbers: Mapping[str, Any] | None = None) -> Scene:
    """Build a scene from the tables of a scene file, with other numbers by name."""
    content = with_origin_of_floors(with_times_of_data(with_named_vehicle(content)))
    faults = Faults()
    faults.keys("", content, SECTIONS)
    tables: dict[str, Any] = {}
    # Not so vehicle and environment: where a vehicle is named, keys of theirs replace single numbers.
    objects = {name: content[name] for name in ("start", "run") if isinstance(content.get(name), KINDS[name])}
    for name in (name for name in SECTIONS[:5] if name not in objects):
        tables[name] = content.get(name, {})
        if not isinstance(tables[name], Mapping):
            faults.add(name, tables[name], "is not a table", f"write [{name}] and its keys below")
            tables[name] = {}
    if not tables["vehicle"] and isinstance(content.get("vehicle", {}), Mapping):
        faults.add("vehicle", "", "is missing", "write [vehicle] with mass and inertia")
    sections = {name: kind for name, kind in KINDS.items() if name != "vehicle" or tables["vehicle"]}
    built = {name: objects.get(name) or _build(faults, name, kind, tables[name]) for name, kind in sections.items()}
    sound = {name: section for name, section in built.items() if section is not None}
    distributions = _distributions(faults, tables["ensemble"].get("vary", {}))
    settings = _build(faults, "ensemble", EnsembleSettings, {**tables["ensemble"], "vary": distributions})
    scene = None
    with faults.including():
        # A default replaces each section that failed, so that the faults of the other sections are found as well.
        lists = {name: content.get(name, ()) for name in ("terms", "events")}
        settings_given = settings if tables["ensemble"] else None
        scene = Scene(**{"vehicle": Vehicle(**_STAND_INS)} | sound | lists, controller=content.get("controller"),
                      ensemble_settings=settings_given)  # fmt: skip
        if numbers and not faults:
            from lgvi_warp.scene.names import file_keys
            from lgvi_warp.scene.numbers import with_numbers

            scene = with_numbers(scene, numbers, file_keys())
    with faults.including():
        if scene is None:
            # Names of a faulty term's parameters are unknown: only names of the other sections can be checked.
            heads = ("vehicle.", "environment.", "start.")
            distributions = {name: value for name, value in distributions.items() if str(name).startswith(heads)}
            settings = EnsembleSettings(vary=distributions)
        sound_scene = scene if {"vehicle", "environment", "start"} <= sound.keys() else None
        names = (scene or Scene(built.get("vehicle") or Vehicle(**_STAND_INS))).parameters()
        _check_ensemble(settings or EnsembleSettings(vary=distributions), sound_scene, tuple(names))
    faults.raise_if_any()
    assert scene is not None
    return scene


def _check_ensemble(settings: EnsembleSettings, scene: Scene | None, parameters: Sequence[str]) -> None:
    """Check that the variations fit the scene, before anything runs; if the scene has faults, check only names."""
    if scene is None:
        check_names(settings.vary, parameters)
    else:
        try:
            Ensemble.of(scene, settings)
        except MemoryError:
            raise SceneError([f"ensemble.members = {settings.members} do not fit into memory. Give less"]) from None


def _build(faults: Faults, name: str, kind: Callable[..., Any], table: Mapping[str, Any]) -> Any:
    """Construct a section's object from its table; on failure add the faults and return None."""
    signature = list(inspect.signature(kind).parameters)
    faults.keys(name, table, signature)
    known = {key: value for key, value in table.items() if key in signature}
    with faults.including():
        return kind(**known)
    return None


_STAND_INS: dict[str, Any] = {"mass": 1.0, "inertia": (1.0, 1.0, 1.0)}


def _distributions(faults: Faults, vary: Any) -> dict[str, Any]:
    """Build the distributions of the table [ensemble.vary], by name."""
    distributions: dict[str, Any] = {}
    if not isinstance(vary, Mapping):
        faults.add("ensemble.vary", vary, "is not a table", 'write [ensemble.vary] and "vehicle.mass" = {...} below')
        return distributions
    for key, value in vary.items():
        with faults.including():
            distributions[key] = distribution_from_dict(f'ensemble.vary."{key}"', value)
    return distributions
