"""What an ensemble asks of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from lgvi_warp.physics.vehicle import Vehicle
from lgvi_warp.scene.settings import EnsembleSettings, RunSettings
from lgvi_warp.scene.start import Environment, Start


@runtime_checkable
class SceneLike(Protocol):
    """The parts of a scene: see Scene, which has them."""

    @property
    def vehicle(self) -> Vehicle:
        """The body."""

    @property
    def environment(self) -> Environment:
        """The water and gravity."""

    @property
    def terms(self) -> Sequence[Any]:
        """What else acts."""

    @property
    def events(self) -> Sequence[Any]:
        """What stops a member."""

    @property
    def start(self) -> Start:
        """The first state."""

    @property
    def run(self) -> RunSettings:
        """Settings of a run."""

    @property
    def ensemble_settings(self) -> EnsembleSettings | None:
        """What varies."""

    def parameters(self) -> dict[str, np.ndarray]:
        """All numbers by name."""

    def to_dict(self) -> dict[str, Any]:
        """In the shape of a scene file."""
