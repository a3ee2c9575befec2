# SPDX-License-Identifier: Apache-2.0
"""Draw docs/gallery/fleet.webp, the moving picture of the README, from a recording: `make gallery ONLY=movie`.

The viewer opens the recording of a fleet that sinks to the sea floor, without a window, and is shot at 40 times. That needs a
Vulkan driver; `apt-get install mesa-vulkan-drivers` has one for the CPU.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "kernels")]
MOVIE = ROOT / "docs" / "gallery" / "fleet.webp"
FRAMES, PERIOD = 40, 120  # number, ms


def record(path: Path) -> np.ndarray:
    """Run 300 REMUS 100 of unknown buoyancy that sink in an unknown current, and write the recording.

    Args:
        path: The file.

    Returns:
        The times of the samples [s].
    """
    import lgvi_warp as lw

    scene = lw.Scene.named(
        "remus_100",
        vehicle={"buoyancy": 285.0},  # N: 14 N less than the weight
        start={"position": [0.0, 0.0, 5.0], "velocity": [1.5, 0.0, 0.0]},
        terms=[lw.terms.Current(velocity=[0.0, 0.2, 0.0])],
        events=[lw.events.Floor(depth=20.0)],
    )
    vary = {
        "vehicle.buoyancy": lw.distributions.Normal(std=1.0),
        "current.velocity": lw.distributions.Normal(std=[0.05, 0.05, 0.0]),
    }
    result = lw.solve(lw.Ensemble(scene, 300, seed=1, vary=vary), h=0.02, t1=110.0, save=lw.SaveAt(every=1.0))
    lw.record(result, path)
    return np.asarray(result.time)


def main() -> None:
    """Write the moving picture."""
    from site_parts.pictures import digest

    from lgvi_warp.views.recording import movie

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        times = record(folder / "fleet.rrd")
        shown = movie.of_recording(folder / "fleet.rrd", np.linspace(times[0], times[-1], FRAMES))
        frames = list(shown)
    look = {"duration": PERIOD, "loop": 0, "quality": 70, "method": 6, "xmp": digest(Path(__file__)).encode()}
    frames[0].save(MOVIE, save_all=True, append_images=frames[1:], **look)
    print(f"{MOVIE.name}: {len(frames)} frames, {MOVIE.stat().st_size / 1e6:.2f} MB")
