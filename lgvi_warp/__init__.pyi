# SPDX-License-Identifier: Apache-2.0
# The public names, one a line: for editors, for type checkers, and for __init__.py, which imports a name when it is used.

from lgvi_warp import bench as bench
from lgvi_warp import control as control
from lgvi_warp import designs as designs
from lgvi_warp import distributions as distributions
from lgvi_warp import events as events
from lgvi_warp import gym as gym
from lgvi_warp import laws as laws
from lgvi_warp import linear as linear
from lgvi_warp import metrics as metrics
from lgvi_warp import notation as notation
from lgvi_warp import plots as plots
from lgvi_warp import statistics as statistics
from lgvi_warp import studies as studies
from lgvi_warp import terms as terms
from lgvi_warp import uq as uq
from lgvi_warp import vehicles as vehicles
from lgvi_warp.calls.merge import merge as merge
from lgvi_warp.calls.predict import predict as predict
from lgvi_warp.calls.prepared import Prepared as Prepared
from lgvi_warp.calls.prepared import prepare as prepare
from lgvi_warp.calls.resume import resume as resume
from lgvi_warp.calls.solve import solve as solve
from lgvi_warp.common.errors import Interrupted as Interrupted
from lgvi_warp.common.errors import MembersFailed as MembersFailed
from lgvi_warp.common.errors import SceneError as SceneError
from lgvi_warp.common.status import Status as Status
from lgvi_warp.common.status import Warnings as Warnings
from lgvi_warp.control.controller import Controller as Controller
from lgvi_warp.methods.method import Method as Method
from lgvi_warp.methods.saveat import SaveAt as SaveAt
from lgvi_warp.physics.vehicle import Vehicle as Vehicle
from lgvi_warp.results.result import Result as Result
from lgvi_warp.scene.ensemble import Ensemble as Ensemble
from lgvi_warp.scene.scene import Scene as Scene
from lgvi_warp.scene.start import Environment as Environment
from lgvi_warp.scene.start import Start as Start
from lgvi_warp.statistics.until import Until as Until
from lgvi_warp.store.export import export as export
from lgvi_warp.store.open import open_run as open_run
from lgvi_warp.store.settings import Store as Store
from lgvi_warp.studies.estimating.estimate import estimate as estimate
from lgvi_warp.studies.search.tune import tune_gains as tune_gains
from lgvi_warp.studies.search.worst_case import worst_case as worst_case
from lgvi_warp.studies.stability.map import stability_map as stability_map
from lgvi_warp.studies.suggest import suggest as suggest
from lgvi_warp.studies.sweeps.output import Sweep as Sweep
from lgvi_warp.studies.sweeps.sweep import sweep as sweep
from lgvi_warp.studies.tradeoff import tradeoff as tradeoff
from lgvi_warp.views.choice import select_members as select_members
from lgvi_warp.views.pages.report import report as report
from lgvi_warp.views.recording.rerun import record as record
from lgvi_warp.views.recording.rerun import show as show

__version__: str
