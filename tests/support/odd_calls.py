# SPDX-License-Identifier: Apache-2.0
"""Calls of public names with one odd argument each, beside good ones: what a slip or a program may give."""

import inspect

import numpy as np

import lgvi_warp as lw
from tests.support.public import NAMED

ODD = (
    None, True, "", "x", "no\x00thing", b"x", -1, 0, 2.5, 2**63, 10**400, float("nan"), float("inf"), 1j, [], [[1]],
    ["a", 1.0], [[1.0], [1.0, 2.0]], (1.0, 2.0), {}, {"a": 1}, {1: 2}, {"a"}, object(), int, np.zeros(3),
    np.zeros((2, 2, 2)), np.array(["a", "b"]), np.array([1.0, np.nan]), np.ma.masked_array([1.0, 2.0], [True, False]),
    np.float32(1.0), np.datetime64("2020-01-01"), range(3),
)  # fmt: skip

BODY = dict(mass=20.0, inertia=(1.5, 4.0, 4.5), added_mass=(5.0, 22.0, 25.0), buoyancy=196.0)
POINT, AHEAD, DOWN = [[0.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0]]

# Records that the library itself makes, errors, and base classes: nobody calls them.
UNCALLED = {
    "Interrupted", "MembersFailed", "Status", "Warnings", "CallbackInput", "Allocation", "ControlLaw", "Guidance",
    "MeasuringPart", "Packed", "PackingContext", "Term", "Event", "NoisyTerm", "Prepared", "Result", "LinearModel",
    "Regulator", "Margins", "Trim", "Tuned", "WorstCase", "StabilityMap", "Sweep", "Prediction", "SceneError", "show",
    "register", "number", "Cell", "Assimilated", "Estimated", "Derivatives", "Final", "RareEvent", "GivenDataIndices",
}  # fmt: skip


CALLED = {"on_block", "progress"}


def goods(scene, fleet, result, folder):
    """Good arguments by the name of what takes them, and by name."""
    schedule = [0.0, 1.0]
    fins = {"position": POINT, "chord": AHEAD, "normal": DOWN, "area": 0.01, "drag": 0.1, "lift_slope": 3.0}
    by_name = {
        "scene": scene, "fleet": fleet, "ensemble": fleet, "result": result, "path": folder / "out", "paths": [],
        "out": folder / "merged", "time_constant": 1.0, "period": 0.1, "kp": 1.0, "kd": 1.0, "kr": 1.0, "kw": 1.0,
        "kp_pitch": 1.0, "lambda_": 1.0, "boundary": 1.0, "k_sigma": 1.0, "k_d": 1.0, "lambda_r": 1.0,
        "boundary_r": 1.0, "k_sigma_r": 1.0, "k_d_r": 1.0, "nomoto_gain": 1.0, "natural_frequency": 1.0,
        "K": np.zeros((6, 12)), "times": schedule, "positions": [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]],
        "points": [[0.0, 0.0, 1.0], [9.0, 0.0, 1.0]], "speed": 1.0, "look_ahead": 2.0, "radius": 1.0,
        "stations": [-1.0, 1.0], "diameters": [0.1, 0.1], "drag_coefficient": 1.0, "velocity": [0.1, 0.0, 0.0],
        "depths": [0.0, 9.0], "velocities": [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], "amplitudes": [1.0], "periods": [5.0],
        "headings_deg": [0.0], "lower": [-9.0] * 3, "upper": [9.0] * 3, "depth": 50.0, "at": 5.0,
        "standard_deviation": [0.1] * 3, "gradient": 1.0, "anchor": [0.0] * 3, "stiffness": 5.0, "direction": AHEAD,
        "force": [[0.0] * 3, [1.0] * 3], "vehicle": lw.Vehicle(**BODY), "name": "depth", "function": len,
        "statistic": "mean depth", "half_width": 1.0, "file": str(folder / "none.npz"), "inputs": ["north"],
        "outputs": ["X"], "to": "csv", "coefficients": {}, "source": "none", "mass": 20.0,
        "term": lw.terms.Drag(linear=[1.0] * 6), "part": lw.control.HeadingPID(kp=1.0), "model": None, "Q": np.eye(2),
        "R": np.eye(2),
        "series": lw.studies.Series("depth", [0.1], [0.0], 0.1), "limit": "depth - 9.0", "time": [0.1], "values": [0.0],
        "std": 0.1, "over": {}, "within": {}, "of": "depth", "minimise": "depth", "found": None, "matrix": np.eye(6),
    }  # fmt: skip
    own = {
        "CurrentHarmonics": {"amplitudes": AHEAD, "periods": [10.0]}, "Fins": fins,
        "ControlFins": {**fins, "command": [0.1]},
        "Thrusters": {"position": POINT, "direction": AHEAD, "coefficient": [1.0], "command": [1.0]}, "Vehicle": BODY,
        "BodyLift": {"matrix": np.zeros((6, 6))}, "Normal": {"std": 1.0}, "Uniform": {"half_width": 1.0},
        "LogNormal": {"sigma": 0.1}, "TruncatedNormal": {"std": 1.0}, "Choice": {"values": [1.0, 2.0]},
        "Quantity": {"name": "depth2"}, "solve": {"h": 0.1, "t1": 0.2}, "predict": {"h": 0.1, "t1": 0.2},
        "prepare": {"h": 0.1, "t1": 0.2},
        "derivatives": {"by": "start.position[2]", "h": 0.1, "t1": 0.2}, "Ensemble": {"members": 4}, "Case": {"name": "a"},
        "KernelDensity": {"draws": [1.0, 2.0, 4.0]}, "gather": {"statistics": [lw.statistics.Mean("depth")]},
        "Copula": {"correlation": np.eye(1), "marginals": [lw.distributions.Normal(std=1.0)]},
        "Derived": {"functions": {"vehicle.mass": lambda k: k}, "k": lw.distributions.Normal(std=1.0)},
        "LinearMPC": {"states": ["velocity[2]"], "inputs": ["Z"], "A": [[0.9]], "B": [[0.1]], "Q": [1.0], "R": [1.0],
                      "limit": [9.0]},
        "Loiter": {"center": POINT}, "Docking": {"position": POINT, "heading": 0.0, "contact_speed": 0.5, "slowing": 9.0,
                                                 "mouth": 0.5, "funnel": 0.2, "approach": 20.0, "judged": 5.0},
        "DockContact": {"of": "speed"},
        "Waypoints": {"points": [[0.0, 0.0, 1.0], [9.0, 0.0, 1.0]]}, "export": {"run": result},
        "BuoyancyEngine": dict(pump_rate=1e-5, volume_down=-1e-4, volume_up=1e-4, depth_top=1.0, depth_bottom=2.0),
        "Tether": {"anchor": [0.0] * 3, "stiffness": 1.0},
        "from_fossen": {"mass": 20.0, "inertia": [1.5, 4.0, 4.5]},
    }  # fmt: skip
    return by_name, own


def odd_calls(scene, fleet, result, folder):
    """(label, function, arguments by name), each with one odd argument."""
    by_name, own = goods(scene, fleet, result, folder)
    for name in sorted(set(NAMED) - UNCALLED):
        function = NAMED[name]
        if not callable(function) or inspect.ismodule(function):
            continue
        known = [
            p
            for p in inspect.signature(function).parameters.values()
            if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
        ]
        fields = function.number_fields() if hasattr(function, "number_fields") else ()
        by_shape = {
            item.name: np.ones([n if isinstance(n, int) else 1 for n in item.metadata["shape"]]) for item in fields
        }
        numbers = by_shape | by_name
        required = {p.name: numbers[p.name] for p in known if p.default is p.empty and p.name in numbers}
        given = {**required, **own.get(name, {})}
        for parameter in known:
            for i, odd in enumerate(ODD):
                # What a user's function raises is his own.
                if not (parameter.name in CALLED and callable(odd)):
                    yield f"{name}({parameter.name}=ODD[{i}])", function, {**given, parameter.name: odd}


def odd_calls_within(scene, result, folder, studies):
    """The same of what is not named in `lw` itself: pictures, sensitivity, and methods of objects; studies: by their class."""
    rows = [
        {"members": 4, "threads": 1, "method": "rk4", "term": "drag", "dtype": "float64", "ns_per_member_step": 9.0}
    ]
    saltelli = lw.Ensemble(
        scene, None, 1, {"vehicle.buoyancy": lw.distributions.Normal(relative=0.01)}, lw.designs.Saltelli(replicates=2)
    )
    path = folder / "within.png"
    pictures = {
        name: {"result": result, "results": {"a": result}, "rows": rows, "path": path, "figure": None, "found": None}
        for name in ("attitude", "compare", "drift", "fan", "histogram", "margins", "outcomes", "pairs", "paths", "phase",
                     "plan_view", "scaling", "statistics", "summary", "term_cost")
    }  # fmt: skip
    asked = {
        "scene": scene, "of": "depth", "fleet": saltelli, "outputs": None, "vary": ["vehicle.mass"], "h": 0.1,
        "t1": 0.2,
    }  # fmt: skip
    called = [(f"plots.{name}", getattr(lw.plots, name), given) for name, given in pictures.items()]
    called += [(f"uq.{name}", getattr(lw.uq, name), asked) for name in ("evaluate", "model", "morris_of", "sobol_of")]
    of_file = {"path": folder / "none.json", "folder": folder / "within"}
    methods = [(scene, "with_numbers", {}), (result, "save", {"path": folder / "a.npz"}), (result, "load", of_file),
               (result.warnings, "has", {}), (lw.laws, "register", {})]  # fmt: skip
    methods += [
        (study, name, of_file) for study in studies for name in ("load", "save", "to_csv") if hasattr(study, name)
    ]
    methods += [(study, name, {}) for study in studies for name in ("select_members", "front") if hasattr(study, name)]
    called += [(f"{type(one).__name__}.{name}", getattr(one, name), given) for one, name, given in methods]
    for label, function, goods in called:
        known = [p for p in inspect.signature(function).parameters.values() if p.kind is not p.VAR_KEYWORD]
        given = {p.name: goods[p.name] for p in known if p.default is p.empty and p.name in goods}
        for parameter in known:
            for i, odd in enumerate(ODD):
                # A function of the user's may raise what it likes; nothing is drawn where nothing is odd.
                if not (callable(odd) or (odd is None and parameter.default is None)):
                    yield f"{label}({parameter.name}=ODD[{i}])", function, {**given, parameter.name: odd}


def methods_of(thing):
    """(name, bound function) of the public methods of an object that this package defines."""
    for name in dir(type(thing)):
        static = inspect.getattr_static(type(thing), name)
        is_method = inspect.isfunction(static) or isinstance(static, classmethod | staticmethod)
        if is_method and not name.startswith("_"):
            bound = getattr(thing, name)
            home = inspect.getmodule(inspect.unwrap(getattr(bound, "__func__", bound)))
            if home is not None and home.__name__.startswith(f"{lw.__name__}."):
                yield name, bound


def odd_calls_of_objects(things, by_name):
    """(label, function, arguments): every public method of each object, with one odd argument; things: by a label."""
    for label, thing in things.items():
        for name, function in methods_of(thing):
            known = [
                p
                for p in inspect.signature(function).parameters.values()
                if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)
            ]
            given = {p.name: by_name.get(p.name) for p in known if p.default is p.empty}
            for parameter in known:
                for i, odd in enumerate(ODD):
                    if not callable(odd):  # a function of the user's may raise what it likes
                        yield f"{label}.{name}({parameter.name}=ODD[{i}])", function, {**given, parameter.name: odd}


def odd_calls_of_functions(functions):
    """(label, function, arguments): functions by name, each with good arguments and one odd one."""
    for name, (function, given) in functions.items():
        for parameter in inspect.signature(function).parameters.values():
            for i, odd in enumerate(ODD):
                if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL) or callable(odd):
                    continue
                # None is what leaves an argument out, and would be a long study.
                if odd is not None or parameter.default is not None:
                    yield f"{name}({parameter.name}=ODD[{i}])", function, {**given, parameter.name: odd}
