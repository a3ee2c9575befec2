"""lgvi_warp: many underwater vehicles at once, by a Lie group variational integrator in Warp kernels on CPU cores."""

from typing import TYPE_CHECKING, Any

from lgvi_warp.common.errors import Interrupted, MembersFailed, SceneError
from lgvi_warp.common.status import Status, Warnings
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import SaveAt
from lgvi_warp.physics.terms import register_term
from lgvi_warp.physics.terms.base import Packed, PackingContext, Term, number
from lgvi_warp.physics.terms.control_fins import ControlFins
from lgvi_warp.physics.terms.cross_flow import CrossFlow
from lgvi_warp.physics.terms.current import Current, CurrentProfile
from lgvi_warp.physics.terms.current_harmonics import CurrentHarmonics
from lgvi_warp.physics.terms.drag import Drag, DragMatrix
from lgvi_warp.physics.terms.events import Box, Event, Floor, StopTime, Surface
from lgvi_warp.physics.terms.fins import Fins
from lgvi_warp.physics.terms.gauss_markov_current import GaussMarkovCurrent
from lgvi_warp.physics.terms.hydrostatics import Restoring, Weight
from lgvi_warp.physics.terms.lift import BodyLift
from lgvi_warp.physics.terms.stratification import Stratification
from lgvi_warp.physics.terms.tether import Tether
from lgvi_warp.physics.terms.thrusters import Thrusters
from lgvi_warp.physics.terms.waves import Waves
from lgvi_warp.physics.terms.wrench import Wrench, WrenchSchedule
from lgvi_warp.physics.terms.wrench_noise import WrenchNoise
from lgvi_warp.physics.vehicle import Vehicle
from lgvi_warp.runs.result import Result
from lgvi_warp.sampling.designs.designs import Morris, Saltelli
from lgvi_warp.sampling.designs.grid import Grid
from lgvi_warp.sampling.designs.hypercube import LatinHypercube
from lgvi_warp.sampling.designs.levels import UnitCubePoints
from lgvi_warp.sampling.designs.random import Random
from lgvi_warp.sampling.designs.sequences import Halton, Sobol
from lgvi_warp.sampling.designs.table import Table
from lgvi_warp.sampling.distributions.basic import Choice, LogNormal, Normal, TruncatedNormal, Uniform
from lgvi_warp.sampling.distributions.joint import (
    CorrelatedNormal,
    PhysicalInertia,
    PositiveDefinite,
    RotationNormal,
    UniformRotation,
)
from lgvi_warp.sampling.distributions.named import ScipyDistribution
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene
from lgvi_warp.scene.start import Environment, Start
from lgvi_warp.statistics.angles import CircularMean, MeanAttitude
from lgvi_warp.statistics.counts import Exceedance, FirstPassage, Histogram
from lgvi_warp.statistics.moments import Covariance, Mean
from lgvi_warp.statistics.order import Extremes, Quantiles
from lgvi_warp.statistics.outcomes import EndTime, Outcome
from lgvi_warp.statistics.path import PathMaximum, PathMean, PathMinimum, PathRange, PathRms, PathTime
from lgvi_warp.statistics.quantity import Quantity
from lgvi_warp.statistics.until import Until

if TYPE_CHECKING:
    from lgvi_warp.engine.laws.check import check_law
    from lgvi_warp.engine.plan import Plan
    from lgvi_warp.runs.predict import predict
    from lgvi_warp.runs.solve import solve
    from lgvi_warp.runs.store.export import export
    from lgvi_warp.runs.store.merge import merge
    from lgvi_warp.runs.store.open import open_run
    from lgvi_warp.runs.store.resume import resume
    from lgvi_warp.runs.store.settings import Store
    from lgvi_warp.scene.vehicles.fossen import vehicle_tables_from_fossen, vehicles
    from lgvi_warp.scene.vehicles.sdf import vehicle_tables_from_sdf
    from lgvi_warp.scene.vehicles.yaml import vehicle_tables_from_yaml
    from lgvi_warp.studies import sensitivity as uq
    from lgvi_warp.studies.stability.map import StabilityMap, stability_map
    from lgvi_warp.studies.suggest import suggest
    from lgvi_warp.studies.tradeoff import tradeoff
    from lgvi_warp.views.plots import plot, plot_stability, plot_statistics, plot_tradeoff
    from lgvi_warp.views.rerun import log_rerun
    from lgvi_warp.views.sensitivity import plot_sensitivity

__version__ = "0.1.0"

# Imported on first use: Warp takes a second to import, and a scene can be read and checked without it.
_LAZY = {
    "solve": "lgvi_warp.runs.solve",
    "Store": "lgvi_warp.runs.store.settings",
    "open_run": "lgvi_warp.runs.store.open",
    "resume": "lgvi_warp.runs.store.resume",
    "merge": "lgvi_warp.runs.store.merge",
    "export": "lgvi_warp.runs.store.export",
    "predict": "lgvi_warp.runs.predict",
    "suggest": "lgvi_warp.studies.suggest",
    "tradeoff": "lgvi_warp.studies.tradeoff",
    "Plan": "lgvi_warp.engine.plan",
    "plot": "lgvi_warp.views.plots",
    "plot_statistics": "lgvi_warp.views.plots",
    "plot_stability": "lgvi_warp.views.plots",
    "plot_tradeoff": "lgvi_warp.views.plots",
    "plot_sensitivity": "lgvi_warp.views.sensitivity",
    "StabilityMap": "lgvi_warp.studies.stability.map",
    "stability_map": "lgvi_warp.studies.stability.map",
    "log_rerun": "lgvi_warp.views.rerun",
    "check_law": "lgvi_warp.engine.laws.check",
    "vehicle_tables_from_fossen": "lgvi_warp.scene.vehicles.fossen",
    "vehicle_tables_from_sdf": "lgvi_warp.scene.vehicles.sdf",
    "vehicle_tables_from_yaml": "lgvi_warp.scene.vehicles.yaml",
    "vehicles": "lgvi_warp.scene.vehicles.fossen",
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
    "GaussMarkovCurrent",
    "Grid",
    "Halton",
    "Histogram",
    "Interrupted",
    "LatinHypercube",
    "LogNormal",
    "Mean",
    "MeanAttitude",
    "MembersFailed",
    "Method",
    "Morris",
    "Normal",
    "Outcome",
    "Packed",
    "PackingContext",
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
    "ScipyDistribution",
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
    "UnitCubePoints",
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
    "log_rerun",
    "merge",
    "number",
    "open_run",
    "plot",
    "plot_sensitivity",
    "plot_stability",
    "plot_statistics",
    "plot_tradeoff",
    "predict",
    "register_term",
    "resume",
    "solve",
    "stability_map",
    "suggest",
    "tradeoff",
    "uq",
    "vehicle_tables_from_fossen",
    "vehicle_tables_from_sdf",
    "vehicle_tables_from_yaml",
    "vehicles",
]


# Public names of modules.
_MODULES = {
    "uq": "lgvi_warp.studies.sensitivity",
    "notation": "lgvi_warp.physics.notation",
    "terms": "lgvi_warp.physics.terms",
}

# Old public names, each with the name that replaces it.
_RENAMED = {
    "Frozen": "ScipyDistribution",
    "Levels": "UnitCubePoints",
    "Setting": "PackingContext",
    "from_fossen": "vehicle_tables_from_fossen",
    "from_sdf": "vehicle_tables_from_sdf",
    "from_yaml": "vehicle_tables_from_yaml",
    "quantity": "number",
    "register": "register_term",
}


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name in _RENAMED:
        import warnings

        warnings.warn(f"lw.{name} is now lw.{_RENAMED[name]}; write that", DeprecationWarning, stacklevel=2)
        return getattr(import_module(__name__), _RENAMED[name])
    if name in _MODULES:
        value: Any = import_module(_MODULES[name])
    elif name in _LAZY:
        value = getattr(import_module(_LAZY[name]), name)
    else:
        raise AttributeError(f"module 'lgvi_warp' has no attribute {name!r}")
    globals()[name] = value
    return value
