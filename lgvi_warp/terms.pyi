# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.extensions.gliders.terms.ballast import Ballast as Ballast
from lgvi_warp.extensions.gliders.terms.buoyancy_engine import BuoyancyEngine as BuoyancyEngine
from lgvi_warp.extensions.gliders.terms.density_profile import DensityProfile as DensityProfile
from lgvi_warp.extensions.gliders.terms.moving_mass import MovingMass as MovingMass
from lgvi_warp.extensions.gliders.terms.polar import Polar as Polar
from lgvi_warp.extensions.gliders.terms.stratification import Stratification as Stratification
from lgvi_warp.extensions.gliders.terms.surface_buoyancy import SurfaceBuoyancy as SurfaceBuoyancy
from lgvi_warp.extensions.sea.terms.bottom_contact import BottomContact as BottomContact
from lgvi_warp.extensions.sea.terms.sea_state import SeaState as SeaState
from lgvi_warp.extensions.sea.terms.tide import Tide as Tide
from lgvi_warp.physics.terms.control_fins import ControlFins as ControlFins
from lgvi_warp.physics.terms.control_wrench import ControlWrench as ControlWrench
from lgvi_warp.physics.terms.cross_flow import CrossFlow as CrossFlow
from lgvi_warp.physics.terms.current import Current as Current
from lgvi_warp.physics.terms.current import CurrentProfile as CurrentProfile
from lgvi_warp.physics.terms.current_field import CurrentField as CurrentField
from lgvi_warp.physics.terms.current_harmonics import CurrentHarmonics as CurrentHarmonics
from lgvi_warp.physics.terms.drag import Drag as Drag
from lgvi_warp.physics.terms.drag import DragMatrix as DragMatrix
from lgvi_warp.physics.terms.energy_use import EnergyUse as EnergyUse
from lgvi_warp.physics.terms.fins import Fins as Fins
from lgvi_warp.physics.terms.gauss_markov_current import GaussMarkovCurrent as GaussMarkovCurrent
from lgvi_warp.physics.terms.hull_loads import HullLoads as HullLoads
from lgvi_warp.physics.terms.hydrostatics import Restoring as Restoring
from lgvi_warp.physics.terms.hydrostatics import Weight as Weight
from lgvi_warp.physics.terms.lift import BodyLift as BodyLift
from lgvi_warp.physics.terms.quadratic_form import QuadraticForm as QuadraticForm
from lgvi_warp.physics.terms.tether import Tether as Tether
from lgvi_warp.physics.terms.thrusters import Thrusters as Thrusters
from lgvi_warp.physics.terms.waves import Waves as Waves
from lgvi_warp.physics.terms.wrench import Wrench as Wrench
from lgvi_warp.physics.terms.wrench import WrenchSchedule as WrenchSchedule
from lgvi_warp.physics.terms.wrench_noise import WrenchNoise as WrenchNoise
