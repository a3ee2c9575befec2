# SPDX-License-Identifier: Apache-2.0
"""The part of a scene that an ensemble uses, as a protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from lgvi_warp.physics.vehicle import Vehicle
from lgvi_warp.scene.settings import EnsembleSettings, RunSettings
from lgvi_warp.scene.start import Environment, Start


@runtime_checkable
class SceneLike(Protocol):
    """Protocol of the parts of a scene that an ensemble needs; `Scene` implements it."""

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle, with mass, inertia and buoyancy."""

    @property
    def environment(self) -> Environment:
        """Gravity and density of the water."""

    @property
    def terms(self) -> Sequence[Any]:
        """Terms that act in addition to weight and buoyancy."""

    @property
    def events(self) -> Sequence[Any]:
        """Events that stop a member's run."""

    @property
    def controller(self) -> Any:
        """Controller of the vehicle, or None."""

    @property
    def parts(self) -> Sequence[Any]:
        """All objects that have numbers: terms, events, and the parts of the controller."""

    @property
    def start(self) -> Start:
        """The state at t = 0, before variation."""

    @property
    def run(self) -> RunSettings:
        """Settings of the run: method, step, duration, ..."""

    @property
    def source(self) -> Mapping[str, Any]:
        """The file of the scene: its name, its text, and the overrides of its keys; empty without a file."""

    @property
    def ensemble_settings(self) -> EnsembleSettings | None:
        """Settings of the ensemble; None if nothing varies."""

    @property
    def ensemble_is_checked(self) -> bool:
        """Whether the ensemble of `ensemble_settings` was built before, and is therefore known to be valid."""

    def note_checked_ensemble(self) -> None:
        """Record that the ensemble of `ensemble_settings` is valid."""

    def parameters(self) -> dict[str, np.ndarray]:
        """Return every number that may vary from member to member."""

    def to_dict(self) -> dict[str, Any]:
        """Return the scene as tables in the form of a scene file."""
