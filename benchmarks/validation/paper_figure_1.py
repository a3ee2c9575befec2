# SPDX-License-Identifier: Apache-2.0
"""Fig. 1 of Nordkvist and Sanyal (2010): energy of their vehicle by Psi, and its position after 150 s."""

import importlib.util
import json
from typing import Any

import numpy as np

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "Nordkvist and Sanyal: the paper's own example"
AGAINST = "published computation"
KNOWN = 'one sentence of the text ("about"); no number in the figure could be read'
PICTURE = "Change of energy by Psi and by Crouch-Grossman 3, and the depth over 150 s"
HEADLINE = "depth at 150 s, printed as about that at 0 s"
SCENES = ("examples/paper.toml", "tests/data/paper_example.json",
          "examples/papers/nordkvist_sanyal_2010/figure_1.py")  # fmt: skip
TIMES = (5.0, 50.0, 150.0)  # s


def measured() -> Content:
    """Run the paper's method with its step, and a method of order 8; compare both with the reference."""
    # The example starts deeper, below a surface; the paper at 10 m.
    scene = lw.Scene.load(ROOT / SCENES[0], {"start.position": [0.0, 0.0, 10.0]})
    truth = json.loads((ROOT / SCENES[1]).read_text())["truth"]
    one = lw.Ensemble(scene, members=1)
    result = lw.solve(one, "psi", h=0.01, t1=150.0, save=lw.SaveAt(every=0.01))
    t, change, depth = result.time, result.energy[:, 0] - result.energy[0, 0], result.position[:, 0, 2]
    fine = lw.solve(one, "rk8", h=0.01, t1=150.0, save=lw.SaveAt(every=1.0))
    rows = [Row(HEADLINE, "m", 10.0, None, depth[-1])]
    for method, run in (("psi", result), ("rk8", fine)):
        for at in TIMES:
            i = int(np.argmin(np.abs(run.time - at)))
            exact = np.array(truth[f"{at:g}"]["b"])
            rows.append(
                Row(
                    f"{method}: distance from the truth at {at:g} s",
                    "m",
                    0.0,
                    None,
                    np.linalg.norm(run.position[i, 0] - exact),
                )
            )
    thirds = np.array_split(np.abs(change), 3)
    rows.append(
        Row("psi: largest change of energy, last third over first", "1", 1.0, None, thirds[2].max() / thirds[0].max())
    )
    rows.append(Row("psi: largest change of energy", "J", 0.0, None, np.abs(change).max()))
    other = curve(*_script().crouch_grossman(scene), 600)
    return Content(rows, {"energy": curve(t, change, 1500), "other": other, "depth": curve(t, depth)})


def _script() -> Any:
    """The example that draws the whole figure."""
    spec = importlib.util.spec_from_file_location("figure_1", ROOT / SCENES[2])
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def draw(content: Content, figure: Any) -> None:
    """Change of energy as in the paper's figure, and the depth."""
    rows = {row.what: row for row in content.rows}
    energy, depth = figure.subplots(1, 2)
    t, change = content.curves["energy"]
    energy.plot(t, 1e3 * np.array(change), color=COMPUTED, linewidth=0.8)
    t, change = content.curves["other"]
    energy.plot(t, 1e3 * np.array(change), "--", color="0.4", linewidth=1.5, label="Crouch-Grossman 3, NumPy")
    energy.plot([], [], color=COMPUTED, label="Psi")
    energy.set(xlabel="time [s]", ylabel="change of energy [mJ]")
    energy.legend(loc="lower left")
    depth.plot(*content.curves["depth"], color=COMPUTED, label="computed")
    depth.plot([0.0, 150.0], [10.0, rows[HEADLINE].published], "o", color=PUBLISHED, label="10 m, and about that again")
    depth.set(xlabel="time [s]", ylabel="depth [m]")
    depth.invert_yaxis()
    depth.legend(loc="upper center")
