# SPDX-License-Identifier: Apache-2.0
"""Whose members a study is about: of an Ensemble, or of a Scene and its section [ensemble]."""

from __future__ import annotations

from typing import Any

from lgvi_warp.common.errors import refusal
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene


def ensemble_of(fleet: Any) -> Ensemble:
    """The members that are meant.

    fleet: An Ensemble, or a Scene, whose [ensemble] is meant.
    """
    if isinstance(fleet, Ensemble):
        return fleet
    if not isinstance(fleet, Scene):
        raise refusal("fleet", fleet, "is neither an Ensemble nor a Scene", "give lw.Scene(...) or lw.Ensemble(...)")
    return Ensemble.from_scene(fleet)


def scene_of(scene: Any) -> Scene:
    """The scene that is meant."""
    scene_itself: Any = scene.scene if isinstance(scene, Ensemble) else scene
    if not isinstance(scene_itself, Scene):
        raise refusal("scene", scene, "is neither a Scene nor an Ensemble", "give lw.Scene(...)")
    return scene_itself
