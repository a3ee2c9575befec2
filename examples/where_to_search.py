# SPDX-License-Identifier: Apache-2.0
"""Where to search for a REMUS 100 that has flooded: README's lines."""

import lgvi_warp as lw

current, floor = lw.terms.Current(velocity=[0.0, 0.2, 0.0]), lw.events.Floor(depth=20.0)
start = {"position": [0, 0, 5], "velocity": [1.5, 0, 0]}  # m and m/s: north, east, down; ahead
scene = lw.Scene.named("remus_100", vehicle={"buoyancy": 285.0}, start=start, terms=[current], events=[floor])
normal = lw.distributions.Normal
unknown = {"vehicle.buoyancy": normal(std=1.0), "current.velocity": normal(std=[0.05, 0.05, 0.0])}  # N and m/s
result = lw.solve(lw.Ensemble(scene, 10_000, seed=1, vary=unknown), h=0.1, t1=240.0, save=lw.SaveAt(every=1.0))
found = lw.studies.footprint(result, "floor")
print(f"{result.status.counts()}\n{found.answer}\nThe 95 % region: {found.main.area_text}")
lw.plots.footprint(found, path="where_to_search.png")
