# SPDX-License-Identifier: Apache-2.0
"""Arguments of public names that are sequences, and the ways in which a user may give one."""

import dataclasses
import inspect
import re
from collections.abc import Mapping

import numpy as np

import lgvi_warp as lw
from tests.support.odd_calls import AHEAD, BODY, DOWN, POINT, UNCALLED
from tests.support.public import DOORS, PATHS, WHOLE


class Column:
    """A column of a data frame, as far as a reader may rely on it."""

    def __init__(self, values):
        self._values = values if isinstance(values, np.ndarray) else array_of(values)

    def __array__(self, dtype=None, copy=None):
        return self._values if dtype is None else self._values.astype(dtype)

    def __iter__(self):
        return iter(self._values.tolist() if self._values.dtype == object else self._values)

    def __len__(self):
        return len(self._values)


def array_of(values):
    """An array of numbers, of texts, or of objects."""
    if all(isinstance(value, str | int | float | list | tuple | np.generic) for value in values):
        try:
            return np.array(values)
        except ValueError:
            pass
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array


def ways_of(values):
    """{name: function that gives the same values in another way}."""
    ways = {
        "tuple": tuple,
        "array": array_of,
        "column": Column,
        "iterator": iter,
        "generator": lambda v: (x for x in v),
    }
    if all(isinstance(value, int | float) for value in values) and not any(isinstance(value, bool) for value in values):
        ways["float64"] = lambda v: [np.float64(x) for x in v]
        if list(values) == list(range(len(values))):
            ways["range"] = lambda v: range(len(v))
    if values and all(isinstance(value, str) for value in values):
        ways["numpy texts"] = lambda v: [np.str_(x) for x in v]
    return ways


def series_of(values):
    """A column of pandas."""
    import pandas as pd

    return pd.Series(values, index=range(10, 10 + len(values)))


def fins(**more):
    return {
        "position": POINT,
        "chord": AHEAD,
        "normal": DOWN,
        "area": [0.01],
        "drag": [0.1],
        "lift_slope": [3.0],
        **more,
    }


THREE, SIX = [0.1, 0.2, 0.3], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
MATRIX = np.diag(SIX).tolist()
NORMAL = lw.distributions.Normal(std=1.0)
THRUSTERS = {"position": POINT, "direction": AHEAD}
BALLAST = {"position": POINT, "limit": [1.0]}
SCHEDULE = {"times": [0.0, 1.0], "command_schedule": [[0.0], [0.5]]}
# Good arguments by path, several sets where they exclude each other; numbers are Python's, sequences are lists.
GOOD = {
    "SaveAt": [{"at": [0, 1, 2], "fields": ["position", "velocity"]}],
    "Store": [{"path": "run.zarr", "fields": ["position", "velocity"]}],
    "Vehicle": [{**BODY, "inertia": [1.5, 4.0, 4.5], "added_mass": [5.0, 22.0, 25.0], "warnings": ["told"],
                 "center_of_buoyancy": THREE},
                {"rigid_body_mass_matrix": np.diag([20.0] * 3 + [1.5, 4.0, 4.5]).tolist(), "added_mass_matrix": MATRIX,
                 "center_of_gravity": [0.0] * 3}],
    "Start": [{"position": THREE, "velocity": THREE, "angular_velocity": THREE, "quaternion_wxyz": [1, 0, 0, 0]},
              {"attitude": np.eye(3).tolist(), "velocity_inertial": THREE}, {"rotation_vector": THREE},
              {"euler_deg": THREE}],
    "Environment": [{"origin": [63.0, 10.0]}],
    "Controller": [{"period": 0.1, "sensors": [lw.control.Sensor(of="depth", name="gauge")], "guidance": [
        lw.control.SetPoint(depth=5.0)], "laws": [lw.control.HeavePID(kp=1.0)], "allocation": [], "faults": []}],
    "control.AllocationMatrix": [{"to": "fins", "matrix": [SIX]}],
    "control.Altimeter": [{"point": THREE, "direction": [0.0, 0.0, 1.0]}],
    "control.BoundedLeastSquares": [{"to": "fins", "weights": [1.0, 2.0], "priorities": SIX}],
    "control.DVL": [{"place": THREE}], "control.DeadReckoning": [{"start_error": THREE}],
    "control.DepthPID": [{"kp": 1.0, "kp_pitch": 1.0, "kd_pitch": 1.0, "integral_limit": [1.0, 2.0]}],
    "control.Docking": [{"position": THREE, "heading": 0.0, "contact_speed": 0.5, "slowing": 9.0, "mouth": 0.5,
                         "funnel": 0.2, "approach": 20.0, "judged": 5.0, "look_ahead": 2.0, "speed": 1.0}],
    "control.ErrorStateFilter": [{"position_sigma": THREE, "velocity_sigma": THREE, "attitude_sigma": THREE,
                                  "accelerometer_sigma": THREE, "gyroscope_sigma": THREE, "gate": [3.0] * 5}],
    "control.IMU": [dict.fromkeys(("place", "accelerometer_noise", "gyroscope_noise", "accelerometer_walk", "gyroscope_walk",
                                   "accelerometer_bias", "gyroscope_bias", "accelerometer_turn_on", "gyroscope_turn_on"),
                                  THREE)],
    "control.LinearMPC": [{"states": ["position[2]", "velocity[2]"], "inputs": ["Z"], "A": [[1.0, 0.1], [0.0, 0.9]],
                           "B": [[0.0], [0.1]], "Q": [1.0, 1.0], "R": [1.0], "limit": [9.0], "P": np.eye(2).tolist(),
                           "rate_limit": [1.0], "tracked": ["position[2]"], "lower": [-9.0], "outputs": [[0.0, 1.0]],
                           "output_limit": [0.3], "excess_cost": [10.0]}],
    "control.Callback": [{"function": print, "to": ["thrusters", "control_fins"]}],
    "control.Loiter": [{"center": THREE, "radius": 5.0, "speed": 1.0, "look_ahead": 2.0}],
    "control.PosePID": [{name: THREE for name in ("kp", "ki", "kd", "kr", "ki_r", "kw")} | {"integral_limit": [1.0, 2.0]}],
    "control.PoseSMC": [{name: THREE for name in ("lambda_", "boundary", "k_sigma", "k_d", "lambda_r", "boundary_r",
                                                  "k_sigma_r", "k_d_r")} | {"integral_limit": [1.0, 2.0]}],
    "control.PseudoInverse": [{"to": "fins", "weights": [1.0, 2.0]}],
    "control.ReferenceModel": [{"natural_frequency": [1.0, 2.0], "damping_ratio": [1.0, 1.0], "rate_limit": [1.0, 1.0]}],
    "control.Sensor": [{"of": "position", "outlier": 0.1, "outlier_std": THREE,
                        **dict.fromkeys(("noise", "bias", "drift", "quantum", "place"), THREE)}],
    "control.SetPoint": [{"position": THREE}],
    "control.StateFeedback": [{"K": np.zeros((6, 12)).tolist()}],
    "control.Trajectory": [{"times": [0, 1], "positions": [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]], "headings": [0.1, 0.2]},
                           {"times": [0, 1], "positions": [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]}],
    "control.Waypoints": [{"points": [[0.0, 0.0, 1.0], [9.0, 0.0, 1.0]], "speed": 1.0, "look_ahead": 2.0, "radius": 1.0},
                          {"points": [[0.0, 0.0, 1.0], [9.0, 0.0, 1.0]], "times": [0.0, 9.0], "look_ahead": 2.0, "speed": 1.0,
                           "radius": 1.0}],
    "designs.Table": [{"values": {"vehicle.mass": [1.0, 2.0]}, "columns": ["vehicle.mass"], "weights": [1, 2]}],
    "designs.UnitCubePoints": [{"points": [[0.1, 0.2], [0.3, 0.4]], "names": ["vehicle.mass", "vehicle.buoyancy"]}],
    "designs.Saltelli": [{"groups": [["start", ["start.position", "start.velocity"]]]}],
    "distributions.Choice": [{"values": [1.0, 2.0], "weights": [0.4, 0.6]}],
    "distributions.Copula": [{"correlation": np.eye(2).tolist(), "marginals": [NORMAL, NORMAL]}],
    "distributions.CorrelatedNormal": [{"std": [1.0, 2.0], "correlation": np.eye(2).tolist(), "mean": [0, 1]},
                                       {"covariance": np.eye(2).tolist()}],
    "distributions.KernelDensity": [{"draws": [0, 1, 2, 3]}], "distributions.LogNormal": [{"sigma": [0.1, 0.2]}],
    "distributions.Normal": [{"std": THREE, "mean": [0, 1, 2]}, {"relative": THREE}],
    "distributions.TruncatedNormal": [{"std": THREE, "low": [-9.0] * 3, "high": [9.0] * 3}],
    "distributions.Uniform": [{"low": [0, 1], "high": [2.0, 3.0]}, {"half_width": THREE}],
    "distributions.RotationNormal": [{"std": THREE}, {"covariance": np.eye(3).tolist()}],
    "distributions.PhysicalInertia": [{"sigma": 0.1}],
    "events.Box": [{"lower": [-9.0] * 3, "upper": [9.0] * 3}],
    "events.Floor": [{"depth": [[1.0, 2.0], [3.0, 4.0]], "origin": [0, 1], "spacing": [1.0, 1.0]}],
    "laws.knots": [{"at": [[0, 1, 2]], "values": [[[1.0], [2.0], [4.0]]]}],
    "metrics.CustomMetric": [{"of": len, "fields": ["position", "velocity"]}],
    "statistics.Mean": [{"of": ["depth", "speed"]}], "statistics.Quantiles": [{"of": "depth", "levels": [0.1, 0.9]}],
    "statistics.Histogram": [{"of": "depth", "edges": [0, 1, 2]}, {"of": "depth", "bins": 4, "limits": [0.0, 9.0]}],
    "statistics.FirstPassage": [{"of": "depth", "above": 1.0, "levels": [0.1, 0.9]}],
    "statistics.Exceedance": [{"of": "position", "above": [0, 1, 2]}],
    "statistics.PathMaximum": [{"of": "depth", "then": [lw.statistics.Mean(), lw.statistics.Quantiles()]}],
    "statistics.Quantity": [{"name": "own", "function": len, "fields": ["position"], "labels": ["own"]}],
    "studies.Series": [{"of": "position[0]", "time": [0.1, 0.2], "values": [[0, 1], [1, 2]], "std": [0.1, 0.2]}],
    "terms.Ballast": [{**BALLAST, **{key: [0.5] for key in ("time_constant", "rate_limit", "efficiency", "command")}},
                      {**BALLAST, **SCHEDULE}],
    "terms.BodyLift": [{"matrix": np.zeros((6, 6)).tolist()}],
    "terms.BuoyancyEngine": [{"pump_rate": 1e-5, "volume_down": -1e-4, "volume_up": 1e-4, "depth_top": 1.0,
                              "depth_bottom": 2.0, "position": THREE}],
    "terms.ControlFins": [fins(drag_normal=[0.1], limit=[0.5], rate_limit=[0.5], time_constant=[0.5], command=[0.1]),
                          fins(**SCHEDULE), {**fins(lift_angles=[0.0, 0.1, 0.2], lift_coefficients=[0.0, 0.3, 0.4]),
                                             "lift_slope": [3.0]}],
    "terms.ControlWrench": [{"limit": SIX, "rate_limit": SIX, "time_constant": SIX}],
    "terms.BottomContact": [{"points": [THREE], "floor": ""}],
    "terms.CrossFlow": [{"stations": [-1.0, 1.0], "diameters": [0.1, 0.1], "drag_coefficient": [1.0, 1.0]}],
    "terms.Current": [{"velocity": [0, 1, 2]}],
    "terms.CurrentField": [{"velocities": np.zeros((1, 2, 2, 2, 2, 3)).tolist(), "origin": THREE, "spacing": [1.0, 1.0, 1.0],
                            "times": [0.0, 9.0]}],
    "terms.CurrentHarmonics": [{"amplitudes": AHEAD, "periods": [10.0], "phases": [0.1]}],
    "terms.CurrentProfile": [{"depths": [0, 1], "velocities": [[1.0, 0.0, 0.0], [0.0] * 3]}],
    "terms.DensityProfile": [{"depths": [0, 1], "densities": [1000.0, 1010.0]}],
    "terms.Drag": [{"linear": SIX, "quadratic": SIX}], "terms.DragMatrix": [{"linear": MATRIX, "quadratic": MATRIX}],
    "terms.Fins": [fins(drag_normal=[0.1])],
    "terms.GaussMarkovCurrent": [{"standard_deviation": THREE, "time_constant": 1.0}],
    "terms.HullLoads": [{"stations": [-1.0, 1.0], "diameters": [0.1, 0.1], "added_mass": [1.0, 1.0],
                         "drag_coefficient": [1.0, 1.0]}],
    "terms.MovingMass": [{"mass": 1.0, "places": [[0.0] * 3, THREE], "times": [0, 1], "reference": THREE}],
    "terms.Polar": [{"drag": 1.0, "lift": 1.0, "pitch": 1.0, "moment_by_rate": THREE}],
    "terms.QuadraticForm": [{"products": ["X_u|u|", "Z_uw"], "values": [-2.0, -20.0]}],
    "terms.SurfaceBuoyancy": [{"heights": [0.1, 0.2], "stations": [-1.0, 1.0]}],
    "terms.Tether": [{"anchor": THREE, "stiffness": 1.0, "attachment": THREE}],
    "terms.Thrusters": [{**THRUSTERS, **{key: [0.5] for key in (
                         "coefficient", "coefficient_astern", "advance_loss", "command", "advance_loss_astern",
                         "torque_coefficient", "torque_loss", "shaft_speed", "efficiency", "dead_band", "limit",
                         "time_constant", "rate_limit")}},
                        {**THRUSTERS, "coefficient": [1.0], **SCHEDULE},
                        {**THRUSTERS, "polynomial": [0.0, 1.0], "polynomial_astern": [0.0, 1.0]},
                        {**THRUSTERS, "table_commands": [-1.0, 0.0, 1.0], "table_thrusts": [[-1.0], [0.0], [1.0]]},
                        {**THRUSTERS, "coefficient": [1.0], "power_commands": [0, 1], "power": [[0.0], [2.0]]}],
    "terms.SeaState": [{"significant_height": 1.0, "peak_period": 6.0, "heading_deg": 30.0, "components": 1,
                        "levels": [[0.5, 0.5]]}],
    "terms.Tide": [{"amplitudes": [0.5], "periods": [100.0], "phases": [0.1]}, {"amplitudes": [0.5], "speeds": [30.0]},
                   {"times": [0, 1], "heights": [0.0, 0.5]}],
    "terms.Waves": [{key: [0.1] for key in ("amplitudes", "phases", "headings_deg")} | {"periods": [5.0]}],
    "terms.Wrench": [{"force": THREE, "torque": THREE}], "terms.WrenchNoise": [{"force": THREE, "torque": THREE}],
    "terms.WrenchSchedule": [{"times": [0, 1], "force": [[0.0] * 3, THREE], "torque": [[0.0] * 3, THREE]}],
    "vehicles.from_fossen": [{"coefficients": {"X_udot": -1.0, "X_u|u|": -1.0, "Xgrid": 1.0}, "mass": 20.0,
                              "inertia": [1.5, 4.0, 4.5], "center_of_gravity": [0.0] * 3, "center_of_buoyancy": THREE,
                              "ignore": ["Xgrid"]}],
    "notation.cross": [{"a": THREE, "b": [0, 1, 2]}], "notation.hat": [{"a": THREE}],
    "notation.matrix_from_euler_deg": [{"angles": THREE}], "notation.matrix_from_quaternion": [{"q": [0, 1, 2, 3]}],
    "notation.matrix_from_rotation_vector": [{"f": THREE}], "notation.off_diagonal": [{"matrices": np.eye(3).tolist()}],
    "notation.principal_axes": [{"J": [np.eye(3).tolist()]}], "notation.quaternion_from_matrix": [{"R": np.eye(3).tolist()}],
    "notation.rotations": [{"R": np.eye(3).tolist()}],
    "notation.rotate_into": [{"Q": np.eye(3).tolist(), "vectors": [THREE]}],
    "notation.rotate_out": [{"Q": np.eye(3).tolist(), "vectors": [THREE]}],
    "notation.to_momenta": [{"M": [np.eye(3).tolist()], "J": [np.eye(3).tolist()], "nu": [THREE], "Om": [THREE]}],
}  # fmt: skip


def called():
    """{path: callable} of all public names that can be called."""
    paths = dict(PATHS)
    for door in WHOLE:
        paths |= {f"{door}.{name}": getattr(DOORS[door], name) for name in DOORS[door].__all__}
    return {path: thing for path, thing in sorted(paths.items()) if callable(thing) and not inspect.ismodule(thing)}


def sequence_arguments(path, thing):
    """The arguments of a public name that are annotated as sequences, or declared with a shape."""
    if path.rpartition(".")[2] in UNCALLED:
        return set()
    shapes = (
        {item.name: item.metadata["shape"] for item in thing.number_fields()} if hasattr(thing, "number_fields") else {}
    )
    pattern = re.compile(r"(^|\W)(Sequence|Iterable|np\.ndarray|list|tuple)(\W|$)")
    return {
        p.name
        for p in inspect.signature(thing).parameters.values()
        if (
            shapes[p.name]
            if p.name in shapes
            else pattern.search(str(p.annotation).replace("Callable[[np.ndarray]", ""))
        )
    }


def state_of(value):
    """A value as plain texts and bytes, so that two are equal if and only if their bits are."""
    if isinstance(value, np.ndarray):
        return (
            ("array", value.dtype.str, value.shape, value.tobytes())
            if value.dtype != object
            else state_of(value.tolist())
        )
    if isinstance(value, list | tuple):
        return [state_of(item) for item in value]
    if isinstance(value, Mapping):
        return {str(name): state_of(item) for name, item in value.items()}
    if hasattr(value, "to_dict") and not isinstance(value, type):
        return type(value).__name__, state_of(value.to_dict())
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return type(value).__name__, {
            item.name: state_of(getattr(value, item.name)) for item in dataclasses.fields(value)
        }
    return value if isinstance(value, str | int | float | None) else str(value)
