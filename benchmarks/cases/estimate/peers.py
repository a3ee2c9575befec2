# SPDX-License-Identifier: Apache-2.0
"""QMCPy's adaptive digital nets over the same model, in the setting that lw.estimate found; where QMCPy can be imported.

Their tolerance is twice the root mean square asked for, as half of a 95 % interval is.
"""

import importlib.util
import time

import numpy as np

import lgvi_warp as lw


def peers(fleet, of, t1, answer, error, seeds, truth):
    """A row of members, processor time and error over seeds; none where QMCPy is not there."""
    if not importlib.util.find_spec("qmcpy"):
        return
    import qmcpy

    asked = of.of if isinstance(of, lw.statistics.Mean) else of
    drawn = lw.Ensemble(fleet.scene, 1, 0, fleet.vary)
    run = lw.prepare(drawn, of=asked, levels=True, t1=t1, threads=1, **answer.settings)
    run(np.full((1, len(run.names)), 0.5))
    members, seconds, apart = [], [], []
    for seed in range(seeds):
        done = [0]

        def numbers(points, done=done, seed=seed, **_):
            inside = np.clip(points, 2.0**-53, 1.0 - 2.0**-53)
            indices = done[0] + np.arange(len(inside))
            done[0] += len(inside)
            return run(inside, seed=seed, indices=indices)

        begun = time.process_time()
        measure = qmcpy.Uniform(qmcpy.DigitalNetB2(len(run.names), seed=seed))
        rule = qmcpy.CubQMCNetG(qmcpy.CustomFun(measure, g=numbers), abs_tol=2.0 * error)
        value, _ = rule.integrate()
        seconds.append(time.process_time() - begun)
        members.append(done[0])
        apart.append((float(np.squeeze(value)) - truth) / error)
    yield {
        "peer": f"QMCPy {qmcpy.__version__}, CubQMCNetG, {answer.setting}",
        "members": int(np.median(members)),
        "seconds": round(float(np.median(seconds)), 4),
        "rms_in_asked": round(float(np.sqrt(np.mean(np.square(apart)))), 2),
    }
