"""lgvi_warp: many underwater vehicles at once, by a Lie group variational integrator in Warp kernels on CPU cores."""

from typing import TYPE_CHECKING, Any

from lgvi_warp.distributions import Choice, LogNormal, Normal, TruncatedNormal, Uniform
from lgvi_warp.ensemble import Ensemble
from lgvi_warp.errors import Interrupted, MembersFailed, SceneError
from lgvi_warp.events import Box, Event, Floor, StopTime, Surface
from lgvi_warp.joint_laws import CorrelatedNormal, PhysicalInertia, PositiveDefinite, RotationNormal, UniformRotation
from lgvi_warp.laws import Frozen
from lgvi_warp.method import Method
from lgvi_warp.result import Result
from lgvi_warp.sampling import Grid, Halton, LatinHypercube, Levels, Morris, Random, Saltelli, Sobol, Table
from lgvi_warp.saveat import SaveAt
from lgvi_warp.scene import Environment, Scene, Start
from lgvi_warp.statistics import (
    CircularMean,
    Covariance,
    EndTime,
    Exceedance,
    Extremes,
    FirstPassage,
    Histogram,
    Mean,
    MeanAttitude,
    Outcome,
    PathMaximum,
    PathMean,
    PathMinimum,
    PathRange,
    PathRms,
    PathTime,
    Quantiles,
    Quantity,
)
from lgvi_warp.statistics.until import Until
from lgvi_warp.status import Status, Warnings
from lgvi_warp.terms import (
    BodyLift,
    ControlFins,
    CrossFlow,
    Current,
    CurrentHarmonics,
    CurrentProfile,
    Drag,
    DragMatrix,
    Fins,
    GaussMarkovCurrent,
    Packed,
    Restoring,
    Setting,
    Stratification,
    Term,
    Tether,
    Thrusters,
    Waves,
    Weight,
    Wrench,
    WrenchNoise,
    WrenchSchedule,
    quantity,
    register,
)
from lgvi_warp.vehicle import Vehicle

if TYPE_CHECKING:
    from lgvi_warp import uq
    from lgvi_warp.coefficients import from_fossen, vehicles
    from lgvi_warp.coefficients_sdf import from_sdf
    from lgvi_warp.coefficients_yaml import from_yaml
    from lgvi_warp.exporting import export
    from lgvi_warp.law_check import check_law
    from lgvi_warp.plan import Plan
    from lgvi_warp.prediction import predict
    from lgvi_warp.resuming import merge, resume
    from lgvi_warp.sinks.plots import plot, plot_stability, plot_statistics, plot_tradeoff
    from lgvi_warp.sinks.rerun import log_rerun
    from lgvi_warp.sinks.sensitivity import plot_sensitivity
    from lgvi_warp.solving import solve
    from lgvi_warp.stability import StabilityMap, stability_map
    from lgvi_warp.store import Store
    from lgvi_warp.stored import open_run
    from lgvi_warp.suggestion import suggest
    from lgvi_warp.tradeoffs import tradeoff

__version__ = "0.1.0"

# Loaded when first used: Warp takes a second to import, and a scene can be read and checked without it.
_LAZY = {
    "solve": "lgvi_warp.solving",
    "Store": "lgvi_warp.store",
    "open_run": "lgvi_warp.stored",
    "resume": "lgvi_warp.resuming",
    "merge": "lgvi_warp.resuming",
    "export": "lgvi_warp.exporting",
    "predict": "lgvi_warp.prediction",
    "suggest": "lgvi_warp.suggestion",
    "tradeoff": "lgvi_warp.tradeoffs",
    "Plan": "lgvi_warp.plan",
    "plot": "lgvi_warp.sinks.plots",
    "plot_statistics": "lgvi_warp.sinks.plots",
    "plot_stability": "lgvi_warp.sinks.plots",
    "plot_tradeoff": "lgvi_warp.sinks.plots",
    "plot_sensitivity": "lgvi_warp.sinks.sensitivity",
    "StabilityMap": "lgvi_warp.stability",
    "stability_map": "lgvi_warp.stability",
    "log_rerun": "lgvi_warp.sinks.rerun",
    "check_law": "lgvi_warp.law_check",
    "from_fossen": "lgvi_warp.coefficients",
    "from_sdf": "lgvi_warp.coefficients_sdf",
    "from_yaml": "lgvi_warp.coefficients_yaml",
    "vehicles": "lgvi_warp.coefficients",
}

__all__ = [
    "BodyLift",
    "Box",
    "Choice",
    "CircularMean",
    "ControlFins",
    "CorrelatedNormal",
    "Covariance",
    "CrossFlow",
    "Current",
    "CurrentHarmonics",
    "CurrentProfile",
    "Drag",
    "DragMatrix",
    "EndTime",
    "Ensemble",
    "Environment",
    "Event",
    "Exceedance",
    "Extremes",
    "Fins",
    "FirstPassage",
    "Floor",
    "Frozen",
    "GaussMarkovCurrent",
    "Grid",
    "Halton",
    "Histogram",
    "Interrupted",
    "LatinHypercube",
    "Levels",
    "LogNormal",
    "Mean",
    "MeanAttitude",
    "MembersFailed",
    "Method",
    "Morris",
    "Normal",
    "Outcome",
    "Packed",
    "PathMaximum",
    "PathMean",
    "PathMinimum",
    "PathRange",
    "PathRms",
    "PathTime",
    "PhysicalInertia",
    "Plan",
    "PositiveDefinite",
    "Quantiles",
    "Quantity",
    "Random",
    "Restoring",
    "Result",
    "RotationNormal",
    "Saltelli",
    "SaveAt",
    "Scene",
    "SceneError",
    "Setting",
    "Sobol",
    "StabilityMap",
    "Start",
    "Status",
    "StopTime",
    "Store",
    "Stratification",
    "Surface",
    "Table",
    "Term",
    "Tether",
    "Thrusters",
    "TruncatedNormal",
    "Uniform",
    "UniformRotation",
    "Until",
    "Vehicle",
    "Warnings",
    "Waves",
    "Weight",
    "Wrench",
    "WrenchNoise",
    "WrenchSchedule",
    "check_law",
    "export",
    "from_fossen",
    "from_sdf",
    "from_yaml",
    "log_rerun",
    "merge",
    "open_run",
    "plot",
    "plot_sensitivity",
    "plot_stability",
    "plot_statistics",
    "plot_tradeoff",
    "predict",
    "quantity",
    "register",
    "resume",
    "solve",
    "stability_map",
    "suggest",
    "tradeoff",
    "uq",
    "vehicles",
]


def __getattr__(name: str) -> Any:
    if name != "uq" and name not in _LAZY:
        raise AttributeError(f"module 'lgvi_warp' has no attribute {name!r}")
    from importlib import import_module

    value = import_module("lgvi_warp.uq") if name == "uq" else getattr(import_module(_LAZY[name]), name)
    globals()[name] = value
    return value
