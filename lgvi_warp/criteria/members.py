# SPDX-License-Identifier: Apache-2.0
"""The scene that a study is about."""

from __future__ import annotations

from typing import Any

from lgvi_warp.common.errors import refusal
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene


def scene_of(scene: Any) -> Scene:
    """The scene that is meant."""
    scene_itself: Any = scene.scene if isinstance(scene, Ensemble) else scene
    if not isinstance(scene_itself, Scene):
        raise refusal("scene", scene, "is neither a Scene nor an Ensemble", "give lw.Scene(...)")
    return scene_itself
