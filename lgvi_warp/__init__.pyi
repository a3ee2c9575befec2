# The public names, one a line: for editors, for type checkers, and for __init__.py, which imports a name when it is used.

from lgvi_warp.common.errors import Interrupted as Interrupted
from lgvi_warp.common.errors import MembersFailed as MembersFailed
from lgvi_warp.common.errors import SceneError as SceneError
from lgvi_warp.common.status import Status as Status
from lgvi_warp.common.status import Warnings as Warnings
from lgvi_warp.engine.laws.check import check_law as check_law
from lgvi_warp.engine.plan import Plan as Plan
from lgvi_warp.methods.method import Method as Method
from lgvi_warp.methods.saveat import SaveAt as SaveAt
from lgvi_warp.physics import notation as notation
from lgvi_warp.physics import terms as terms
from lgvi_warp.physics.control.base import ControlLaw as ControlLaw
from lgvi_warp.physics.control.base import Guidance as Guidance
from lgvi_warp.physics.control.controller import Controller as Controller
from lgvi_warp.physics.control.depth_pid import DepthPID as DepthPID
from lgvi_warp.physics.control.fault import Fault as Fault
from lgvi_warp.physics.control.heading_pid import HeadingPID as HeadingPID
from lgvi_warp.physics.control.matrix import AllocationMatrix as AllocationMatrix
from lgvi_warp.physics.control.pseudo_inverse import PseudoInverse as PseudoInverse
from lgvi_warp.physics.control.set_point import SetPoint as SetPoint
from lgvi_warp.physics.terms import register_term as register_term
from lgvi_warp.physics.terms.base import Packed as Packed
from lgvi_warp.physics.terms.base import PackingContext as PackingContext
from lgvi_warp.physics.terms.base import Term as Term
from lgvi_warp.physics.terms.base import number as number
from lgvi_warp.physics.terms.control_fins import ControlFins as ControlFins
from lgvi_warp.physics.terms.control_wrench import ControlWrench as ControlWrench
from lgvi_warp.physics.terms.cross_flow import CrossFlow as CrossFlow
from lgvi_warp.physics.terms.current import Current as Current
from lgvi_warp.physics.terms.current import CurrentProfile as CurrentProfile
from lgvi_warp.physics.terms.current_harmonics import CurrentHarmonics as CurrentHarmonics
from lgvi_warp.physics.terms.drag import Drag as Drag
from lgvi_warp.physics.terms.drag import DragMatrix as DragMatrix
from lgvi_warp.physics.terms.events import Box as Box
from lgvi_warp.physics.terms.events import Event as Event
from lgvi_warp.physics.terms.events import Floor as Floor
from lgvi_warp.physics.terms.events import StopTime as StopTime
from lgvi_warp.physics.terms.events import Surface as Surface
from lgvi_warp.physics.terms.fins import Fins as Fins
from lgvi_warp.physics.terms.gauss_markov_current import GaussMarkovCurrent as GaussMarkovCurrent
from lgvi_warp.physics.terms.hydrostatics import Restoring as Restoring
from lgvi_warp.physics.terms.hydrostatics import Weight as Weight
from lgvi_warp.physics.terms.lift import BodyLift as BodyLift
from lgvi_warp.physics.terms.noisy import NoisyTerm as NoisyTerm
from lgvi_warp.physics.terms.stratification import Stratification as Stratification
from lgvi_warp.physics.terms.tether import Tether as Tether
from lgvi_warp.physics.terms.thrusters import Thrusters as Thrusters
from lgvi_warp.physics.terms.waves import Waves as Waves
from lgvi_warp.physics.terms.wrench import Wrench as Wrench
from lgvi_warp.physics.terms.wrench import WrenchSchedule as WrenchSchedule
from lgvi_warp.physics.terms.wrench_noise import WrenchNoise as WrenchNoise
from lgvi_warp.physics.vehicle import Vehicle as Vehicle
from lgvi_warp.runs.predict import predict as predict
from lgvi_warp.runs.prepared import Prepared as Prepared
from lgvi_warp.runs.prepared import prepare as prepare
from lgvi_warp.runs.result import Result as Result
from lgvi_warp.runs.solve import solve as solve
from lgvi_warp.runs.store.export import export as export
from lgvi_warp.runs.store.merge import merge as merge
from lgvi_warp.runs.store.open import open_run as open_run
from lgvi_warp.runs.store.resume import resume as resume
from lgvi_warp.runs.store.settings import Store as Store
from lgvi_warp.sampling.designs.designs import Morris as Morris
from lgvi_warp.sampling.designs.designs import Saltelli as Saltelli
from lgvi_warp.sampling.designs.grid import Grid as Grid
from lgvi_warp.sampling.designs.hypercube import LatinHypercube as LatinHypercube
from lgvi_warp.sampling.designs.levels import UnitCubePoints as UnitCubePoints
from lgvi_warp.sampling.designs.random import Random as Random
from lgvi_warp.sampling.designs.sequences import Halton as Halton
from lgvi_warp.sampling.designs.sequences import Sobol as Sobol
from lgvi_warp.sampling.designs.table import Table as Table
from lgvi_warp.sampling.distributions.basic import Choice as Choice
from lgvi_warp.sampling.distributions.basic import LogNormal as LogNormal
from lgvi_warp.sampling.distributions.basic import Normal as Normal
from lgvi_warp.sampling.distributions.basic import TruncatedNormal as TruncatedNormal
from lgvi_warp.sampling.distributions.basic import Uniform as Uniform
from lgvi_warp.sampling.distributions.joint import CorrelatedNormal as CorrelatedNormal
from lgvi_warp.sampling.distributions.joint import PhysicalInertia as PhysicalInertia
from lgvi_warp.sampling.distributions.joint import PositiveDefinite as PositiveDefinite
from lgvi_warp.sampling.distributions.joint import RotationNormal as RotationNormal
from lgvi_warp.sampling.distributions.joint import UniformRotation as UniformRotation
from lgvi_warp.sampling.distributions.named import ScipyDistribution as ScipyDistribution
from lgvi_warp.scene.ensemble import Ensemble as Ensemble
from lgvi_warp.scene.scene import Scene as Scene
from lgvi_warp.scene.start import Environment as Environment
from lgvi_warp.scene.start import Start as Start
from lgvi_warp.scene.vehicles.fossen import vehicle_tables_from_fossen as vehicle_tables_from_fossen
from lgvi_warp.scene.vehicles.fossen import vehicles as vehicles
from lgvi_warp.scene.vehicles.sdf import vehicle_tables_from_sdf as vehicle_tables_from_sdf
from lgvi_warp.scene.vehicles.yaml import vehicle_tables_from_yaml as vehicle_tables_from_yaml
from lgvi_warp.statistics.angles import CircularMean as CircularMean
from lgvi_warp.statistics.angles import MeanAttitude as MeanAttitude
from lgvi_warp.statistics.counts import Exceedance as Exceedance
from lgvi_warp.statistics.counts import FirstPassage as FirstPassage
from lgvi_warp.statistics.counts import Histogram as Histogram
from lgvi_warp.statistics.moments import Covariance as Covariance
from lgvi_warp.statistics.moments import Mean as Mean
from lgvi_warp.statistics.order import Extremes as Extremes
from lgvi_warp.statistics.order import Quantiles as Quantiles
from lgvi_warp.statistics.outcomes import EndTime as EndTime
from lgvi_warp.statistics.outcomes import Outcome as Outcome
from lgvi_warp.statistics.path import PathMaximum as PathMaximum
from lgvi_warp.statistics.path import PathMean as PathMean
from lgvi_warp.statistics.path import PathMinimum as PathMinimum
from lgvi_warp.statistics.path import PathRange as PathRange
from lgvi_warp.statistics.path import PathRms as PathRms
from lgvi_warp.statistics.path import PathTime as PathTime
from lgvi_warp.statistics.quantity import Quantity as Quantity
from lgvi_warp.statistics.until import Until as Until
from lgvi_warp.studies import sensitivity as uq
from lgvi_warp.studies.stability.map import StabilityMap as StabilityMap
from lgvi_warp.studies.stability.map import stability_map as stability_map
from lgvi_warp.studies.suggest import suggest as suggest
from lgvi_warp.studies.tradeoff import tradeoff as tradeoff
from lgvi_warp.views.plots import plot as plot
from lgvi_warp.views.plots import plot_stability as plot_stability
from lgvi_warp.views.plots import plot_statistics as plot_statistics
from lgvi_warp.views.plots import plot_tradeoff as plot_tradeoff
from lgvi_warp.views.rerun import log_rerun as log_rerun
from lgvi_warp.views.sensitivity import plot_sensitivity as plot_sensitivity

__version__: str

# Old public names.
Frozen = ScipyDistribution
Levels = UnitCubePoints
Setting = PackingContext
from_fossen = vehicle_tables_from_fossen
from_sdf = vehicle_tables_from_sdf
from_yaml = vehicle_tables_from_yaml
quantity = number
register = register_term
