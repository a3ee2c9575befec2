# SPDX-License-Identifier: Apache-2.0
"""Problems of benchmarks and tests: the paper's vehicle in nearly neutral trim with each term alone, and with all; states."""

from dataclasses import replace

import numpy as np

import lgvi_warp as lw
from benchmarks.coupled_problems import GENERAL
from lgvi_warp import terms
from lgvi_warp.physics import notation

GRAVITY = 9.8
START = lw.Start([0.0, 0.0, 10.0], rotation_vector=[1.0, 2.0, 3.0], velocity_inertial=[0.3, 0.2, 0.1],
                 angular_velocity=[0.3, 0.2, 0.1])  # fmt: skip


def vehicle():
    """Vehicle of Nordkvist & Sanyal (2010), ballasted to a weight of 0.24 N in water: in a minute it hardly sinks."""
    return lw.Vehicle(
        123.8,
        inertia=[5.46, 5.29, 5.72],
        added_mass=[65.0, 70.0, 75.0],
        buoyancy=1213.0,
        center_of_buoyancy=[0.0, 0.0, -0.007],
    )


def full_matrix(seed, diagonal, beside):
    """(6, 6) with this diagonal, and beside it numbers up to a fraction `beside` of the diagonal ones that they join."""
    size = np.sqrt(np.outer(diagonal, diagonal))
    return np.diag(diagonal) + beside * size * np.random.default_rng(seed).uniform(-1.0, 1.0, (6, 6)) * (1 - np.eye(6))


def drag_matrix():
    """Linear and quadratic, every entry there."""
    return terms.DragMatrix(
        linear=full_matrix(1, [20.0, 60.0, 60.0, 4.0, 6.0, 6.0], 0.1),
        quadratic=full_matrix(2, [20.0, 80.0, 80.0, 3.0, 5.0, 5.0], 0.05),
    )


def current():
    return terms.Current(velocity=[0.2, -0.1, 0.0])


def current_profile():
    """Four depths, which the vehicle stays between."""
    velocities = [[0.4, 0.1, 0.0], [0.3, 0.2, 0.02], [0.1, 0.1, -0.02], [0.0, -0.1, 0.0]]
    return terms.CurrentProfile(depths=[0.0, 8.0, 16.0, 60.0], velocities=velocities)


def current_field(times=1):
    """A swirl of 2 MB, for vehicles in cells of their own: 44 x 44 x 44 nodes, or fewer at several times."""
    n = round((44**3 / times) ** (1.0 / 3.0))
    x = np.linspace(-40.0, 40.0, n)
    north, east, depth = np.meshgrid(x, x, np.linspace(0.0, 40.0, n), indexing="ij")
    decay = 0.01 * np.exp(-depth / 40.0)
    field = np.stack([-east * decay, north * decay, 0.001 * north], axis=-1)
    grid = {"origin": [-40.0, -40.0, 0.0], "spacing": [80.0 / (n - 1), 80.0 / (n - 1), 40.0 / (n - 1)]}
    if times == 1:
        return terms.CurrentField(velocities=field, **grid)
    return terms.CurrentField(
        velocities=np.stack([field * (1.0 + 0.1 * i) for i in range(times)]), times=[0.0, 1.0], **grid
    )


def one_cell():
    """A field of one cell, in which all vehicles are."""
    x = np.array([-1e4, 1e4])
    north, east, depth = np.meshgrid(x, x, [0.0, 1e3], indexing="ij")
    field = 1e-5 * np.stack([-east, north, 0.1 * depth], axis=-1)
    return terms.CurrentField(velocities=field, origin=[-1e4, -1e4, 0.0], spacing=[2e4, 2e4, 1e3])


def current_harmonics():
    return terms.CurrentHarmonics(
        amplitudes=[[0.1, 0.05, 0.0], [0.05, -0.05, 0.01], [0.02, 0.03, -0.01]],
        periods=[60.0, 25.0, 11.0],
        phases=[0.0, 1.0, 2.0],
    )


def waves():
    """Eight components."""
    return terms.Waves(
        amplitudes=[0.3, 0.28, 0.25, 0.2, 0.15, 0.1, 0.08, 0.05],
        periods=[9.0, 8.3, 7.6, 7.0, 6.4, 5.8, 5.1, 4.5],
        headings_deg=[20.0, 35.0, 5.0, -10.0, 50.0, 25.0, -30.0, 70.0],
        phases=[0.0, 0.8, 1.6, 2.4, 3.2, 4.0, 4.8, 5.6],
    )


def sea():
    """Twenty components, as `sea_state` has by default."""
    turn = np.arange(20)
    return terms.Waves(
        amplitudes=[0.08] * 20,
        periods=np.linspace(4.5, 9.0, 20),
        headings_deg=20.0 + 50.0 * np.sin(2.4 * turn),
        phases=0.8 * turn,
    )


def gauss_markov_current():
    return terms.GaussMarkovCurrent(standard_deviation=[0.1, 0.1, 0.02], time_constant=20.0)


def tether():
    """Taut at the start."""
    return terms.Tether(anchor=[0.0, 0.0, 0.0], stiffness=2.0, attachment=[0.4, 0.0, -0.1], rest_length=8.0)


def wrench():
    return terms.Wrench(force=[2.0, -1.0, 0.5], torque=[0.01, -0.01, 0.02])


def wrench_schedule():
    """Four times."""
    return terms.WrenchSchedule(
        times=[0.0, 10.0, 20.0, 60.0],
        force=[[0.0, 0.0, 0.0], [3.0, 1.0, -1.0], [-2.0, 0.0, 1.0], [1.0, -1.0, 0.0]],
        torque=[[0.0, 0.0, 0.0], [0.01, 0.0, 0.02], [0.0, -0.02, 0.0], [-0.01, 0.01, 0.0]],
    )


def thrusters():
    """Four, two ahead, one abeam and one down; with a lag and a dead band, commands at four times."""
    return terms.Thrusters(
        position=[[-0.5, 0.2, 0.0], [-0.5, -0.2, 0.0], [0.0, 0.0, 0.05], [0.05, 0.0, 0.0]],
        direction=[[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        coefficient=[10.0, 10.0, 5.0, 5.0],
        coefficient_astern=[8.0, 8.0, 4.0, 4.0],
        dead_band=[0.05, 0.05, 0.1, 0.1],
        limit=[1.0, 1.0, 0.8, 0.8],
        time_constant=[0.3, 0.3, 0.2, 0.2],
        times=[0.0, 5.0, 15.0, 60.0],
        command_schedule=[[0.5, 0.5, 0.2, 0.0], [0.8, 0.7, -0.3, 0.2], [0.6, 0.7, 0.3, -0.2], [0.6, 0.6, 0.0, 0.1]],
    )


def fins():
    """Four in a cross at the stern."""
    return terms.Fins(
        position=[[-0.6, 0.15, 0.0], [-0.6, -0.15, 0.0], [-0.6, 0.0, 0.15], [-0.6, 0.0, -0.15]],
        chord=[[1.0, 0.0, 0.0]] * 4,
        normal=[[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
        area=0.02,
        lift_slope=3.0,
        drag=0.02,
        drag_normal=1.2,
    )


def control_fins():
    """A rudder and an elevator with a limited rate, commands at four times."""
    return terms.ControlFins(
        position=[[-0.8, 0.0, 0.0], [-0.8, 0.0, 0.0]],
        chord=[[1.0, 0.0, 0.0]] * 2,
        normal=[[0.0, 1.0, 0.0], [0.0, 0.0, -1.0]],
        area=0.015,
        lift_slope=3.0,
        drag=0.02,
        drag_normal=1.0,
        limit=0.35,
        rate_limit=0.3,
        times=[0.0, 5.0, 15.0, 60.0],
        command_schedule=[[0.0, 0.0], [0.2, -0.1], [-0.3, 0.1], [0.1, 0.0]],
    )


def cross_flow():
    """Ten stations, so eighteen strips."""
    x = np.linspace(-0.9, 0.9, 10)
    return terms.CrossFlow(stations=x, diameters=0.4 * np.sqrt(1.0 - x**2), drag_coefficient=1.1)


def hull_loads(stations=10):
    """Ten stations, so eighteen strips."""
    x = np.linspace(-0.9, 0.9, stations)
    return terms.HullLoads(stations=x, diameters=0.4 * np.sqrt(1.0 - x**2), drag_coefficient=1.1)


def body_lift():
    """Lift and its moment in sway and heave, and of the rates."""
    matrix = np.zeros((6, 6))
    matrix[[1, 2, 4, 5, 4, 5], [1, 2, 2, 1, 4, 5]] = 8.0, 8.0, 2.0, -2.0, 1.0, 1.0
    return terms.BodyLift(matrix=matrix)


def stratification():
    return terms.Stratification(gradient=0.005, reference_depth=10.0)


def ballast():
    """Two tanks that follow a schedule at a limited rate."""
    return terms.Ballast(position=[[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]], rate_limit=1e-4, times=[0.0, 1.0, 2.0, 3.0],
                         command_schedule=[[0.0, 0.0], [1e-4, -1e-4], [-1e-4, 1e-4], [0.0, 0.0]])  # fmt: skip


def buoyancy_engine():
    return terms.BuoyancyEngine(pump_rate=1e-4, volume_down=-1e-4, volume_up=1e-4, depth_top=5.0, depth_bottom=15.0,
                                position=[0.5, 0.0, 0.0])  # fmt: skip


def surface_buoyancy():
    """Five stations, so eight parts, below the surface."""
    return terms.SurfaceBuoyancy(heights=[0.1, 0.3, 0.3, 0.3, 0.1], stations=[-0.9, -0.5, 0.0, 0.5, 0.9])


def quadratic_form():
    """Eight products."""
    products = ["X_u|u|", "Y_v|v|", "Z_w|w|", "K_p|p|", "M_q|q|", "N_r|r|", "Y_ur", "M_uw"]
    return terms.QuadraticForm(products=products, values=[-20.0, -80.0, -80.0, -3.0, -5.0, -5.0, 4.0, 3.0])


def moving_mass(inertia="auto"):
    """Along a path, by its weight; or with its inertia."""
    places = [[0.0, 0.0, 0.05], [0.05, 0.0, 0.05], [0.0, 0.0, 0.05]]
    return terms.MovingMass(mass=1.0, places=places, times=[0.0, 1.0, 2.0], inertia=inertia)


def polar():
    """The coefficients of the Seawing glider."""
    return lw.Scene.named("seawing").terms[0]


def wrench_noise():
    return terms.WrenchNoise(force=[0.5, 0.5, 0.5], torque=[0.02, 0.02, 0.02])


ALL = (drag_matrix, current, current_profile, current_harmonics, waves, gauss_markov_current, tether, wrench,
       wrench_schedule, thrusters, fins, control_fins, cross_flow, body_lift, stratification, wrench_noise)  # fmt: skip


def drag(quadratic_only=False):
    """Along the axes of the inertia: by its exact flow."""
    linear = {} if quadratic_only else {"linear": [20.0, 60.0, 60.0, 4.0, 6.0, 6.0]}
    return terms.Drag(**linear, quadratic=[20.0, 80.0, 80.0, 3.0, 5.0, 5.0])


def scene(*laws, events=()):
    """The vehicle with these terms."""
    return lw.Scene(vehicle(), lw.Environment(gravity=GRAVITY), terms=list(laws), start=START, events=list(events))


def all_terms(noise=True):
    """All terms at once, drag as a matrix. noise: with the two that are random."""
    random = (gauss_markov_current, wrench_noise)
    return scene(*(make() for make in ALL if noise or make not in random))


def each_term():
    """Name -> the scene with that term alone; "none" has weight, buoyancy and restoring moment, as all have."""
    box = lw.events.Box(lower=[-1e4] * 3, upper=[1e4] * 3)
    alone = {make.__name__: scene(make()) for make in ALL}
    first = {"none": scene(), "drag": scene(drag()), "quadratic drag": scene(drag(quadratic_only=True))}
    hull = {
        "hull_loads": scene(hull_loads()),
        "waves, hull_loads": scene(waves(), hull_loads()),
        "hull_loads, 4 stations": scene(hull_loads(4)),
        "current_profile, hull_loads": scene(current_profile(), hull_loads()),
        "current_profile, hull_loads, 4 stations": scene(current_profile(), hull_loads(4)),
    }
    fields = {
        "current_field": scene(current_field()),
        "current_field, 4 times": scene(current_field(4)),
        "current_field, all in one cell of it": scene(current_field()),
        "current_field, one cell": scene(one_cell()),
    }
    own = (ballast, buoyancy_engine, polar, moving_mass, surface_buoyancy, quadratic_form)
    glider = {make.__name__: scene(make()) for make in own}
    powered = replace(thrusters(), power_commands=[-1.0, 0.0, 1.0], power=[200.0, 0.0, 250.0])
    glider["thrusters, energy_use"] = scene(powered, terms.EnergyUse(hotel=20.0))
    pumped = replace(buoyancy_engine(), efficiency=0.5)
    glider["buoyancy_engine, energy_use"] = scene(pumped, terms.EnergyUse(hotel=20.0))
    glider["stratification, compressibility"] = scene(replace(stratification(), compressibility=0.003))
    glider["waves, 20 components"] = scene(sea())
    x = np.linspace(-50.0, 50.0, 101)
    hills = 60.0 + np.sin(x / 5.0)[:, None] * np.cos(x / 7.0)
    floor = lw.events.Floor(depth=hills, origin=[-50.0, -50.0], spacing=[1.0, 1.0])
    events = {"events: box": scene(events=[box]), "events: floor": scene(events=[lw.events.Floor(depth=60.0)])}
    return first | alone | hull | fields | glider | events | {"events: floor on a grid": scene(events=[floor])}


def coupled():
    """Name -> a vehicle whose M and J are coupled, with no terms: for psi_x, psi_x8 and psi_w."""
    named = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.5})  # as printed it rises at metres a second
    rigid = np.diag([20.0, 20.0, 20.0, 0.5, 2.5, 2.5])
    general = lw.Vehicle(rigid_body_mass_matrix=rigid, added_mass_matrix=GENERAL - rigid, weight=196.0, buoyancy=196.5,
                         center_of_buoyancy=[0.0, 0.0, -0.02])  # fmt: skip
    return {
        "remus_100": lw.Scene(named.vehicle, named.environment, start=START),
        "general 6x6": lw.Scene(general, lw.Environment(gravity=GRAVITY), start=START),
    }


def random_states(seed, n, speed=1.0, spin=1.0):
    """b, R, nu, Om of n random states."""
    rng = np.random.default_rng(seed)
    R = notation.matrix_from_rotation_vector(rng.normal(size=(n, 3)))
    return rng.normal(size=(n, 3)), R, speed * rng.normal(size=(n, 3)), spin * rng.normal(size=(n, 3))


def difference(x, y):
    """Largest difference of two states (b, R, nu, Om), each relative to the size of its quantity, at least 1."""
    return max(np.abs(u - v).max() / max(1.0, np.abs(v).max()) for u, v in zip(x, y, strict=True))


def slope(h, error):
    """Fitted order of convergence."""
    return np.polyfit(np.log(h), np.log(error), 1)[0]


class DepthSum:
    """A keeper of the simplest kind: the sum of the depths of each sample time; its parts go into a store and come back.

    sums: (k,) [m] over all members. merged: the first members of the blocks, as they came.
    """

    name = "depth sum"

    def __init__(self, plan):
        self.sums, self.merged = np.zeros(len(plan.grid.times)), []

    def open(self, plan, block, members):
        return BlockSum(len(plan.grid.times))

    def merge(self, block, part):
        self.sums += part
        self.merged.append(block.first)

    def to_arrays(self, part):
        return {"sums": part}, {"times": len(part)}

    def from_arrays(self, arrays, content):
        assert len(arrays["sums"]) == content["times"]
        return arrays["sums"]


class BlockSum:
    def __init__(self, times):
        self.sums = np.zeros(times)

    def take(self, when, samples):
        self.sums[when] = samples["position"][..., 2].sum(axis=1)

    def close(self, outcome):
        return self.sums
