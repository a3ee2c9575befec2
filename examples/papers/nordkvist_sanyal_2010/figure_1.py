# SPDX-License-Identifier: Apache-2.0
"""Fig. 1 of Nordkvist & Sanyal (2010): energy error of Psi (Warp kernel) and of Crouch-Grossman 3 (NumPy reference).

    python examples/papers/nordkvist_sanyal_2010/figure_1.py [figure_1.png]

The paper does not print g; with g = 9.8 the vehicle is back at its first depth after 150 s, as the paper says.
"""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw
from lgvi_warp.reference import classical
from lgvi_warp.reference.submaps import Body
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight

SCENE = Path(__file__).resolve().parents[2] / "paper.toml"
H, SHORT, LONG = 0.01, 5.0, 150.0


def psi(scene):
    """(t, E(t) - E(0)) after every step of Psi, by the Warp kernel."""
    result = lw.solve(lw.Ensemble(scene, members=1), "psi", h=H, t1=LONG, save=lw.SaveAt(every=H))
    return result.time, result.energy[:, 0] - result.energy[0, 0]


def crouch_grossman(scene):
    """(t, E(t) - E(0)) after every step of Crouch-Grossman 3, by the NumPy reference."""
    vehicle, gravity = scene.vehicle, scene.environment.gravity
    terms = (
        Weight(net=vehicle.mass * gravity - vehicle.buoyancy),
        Restoring(moment=vehicle.buoyancy * vehicle.center_of_buoyancy),
    )
    body = Body(vehicle.mass_matrix, vehicle.inertia, terms)
    one = lw.Ensemble(scene, members=1).select(0, 1)
    x = (one.position[0], one.attitude[0], one.velocity[0], one.angular_velocity[0])
    energies = [total_energy(x, body)]
    for _ in range(round(LONG / H)):
        x = classical.cg3(*x, body, H)
        energies.append(total_energy(x, body))
    return H * np.arange(len(energies)), np.array(energies) - energies[0]


def total_energy(x, body):
    """nu.M nu / 2 + Om.J Om / 2 + U(b, R)."""
    b, R, nu, Om = x
    return 0.5 * nu @ body.M @ nu + 0.5 * Om @ body.J @ Om + body.potential(b, R)


def numbers(t, change):
    """Change of largest size (with its sign) and its time on 0-5 s; largest |dE| on 0-150 s; dE(150)."""
    short = t <= SHORT + 0.5 * H
    worst = int(np.argmax(np.abs(change[short])))
    return {
        "short": float(change[worst]),
        "at": float(t[worst]),
        "long": float(np.abs(change).max()),
        "end": float(change[-1]),
    }


def draw(curves, path):
    """Both panels, as in the paper: solid Psi, dashed Crouch-Grossman."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    for axes, end in zip(figure.subplots(1, 2), (SHORT, LONG), strict=True):
        for (name, (t, change)), style in zip(curves.items(), ("-", "--"), strict=True):
            chosen = t <= end + 0.5 * H
            axes.plot(t[chosen], change[chosen], style, color="black", linewidth=0.9, label=name)
        axes.set(xlabel="t [s]", ylabel="energy error [J]", xlim=(0.0, end))
        axes.legend()
    figure.savefig(path, dpi=120)


def main(path):
    """Compute, draw and print."""
    # The example starts deeper, below a surface; the paper at 10 m.
    scene = lw.Scene.load(SCENE, {"start.position": [0.0, 0.0, 10.0]})
    curves = {"Psi": psi(scene), "Crouch-Grossman 3": crouch_grossman(scene)}
    draw(curves, path)
    return {name: numbers(*curve) for name, curve in curves.items()}


if __name__ == "__main__":
    target = sys.argv[1] if len(sys.argv) > 1 else "figure_1.png"
    for name, values in main(target).items():
        print(
            f"{name:18s} largest on 0-5 s {values['short']:+.4e} J at t = {values['at']:.2f} s, "
            f"largest on 0-150 s {values['long']:.5e} J, at 150 s {values['end']:+.4e} J"
        )
    print(target)
