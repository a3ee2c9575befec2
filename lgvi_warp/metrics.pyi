# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.criteria.risk import CVaR as CVaR
from lgvi_warp.extensions.navigation.consistency import Consistency as Consistency
from lgvi_warp.extensions.navigation.consistency import consistency as consistency
from lgvi_warp.extensions.navigation.metrics import NEES as NEES
from lgvi_warp.extensions.navigation.metrics import NIS as NIS
from lgvi_warp.extensions.navigation.metrics import Rejected as Rejected
from lgvi_warp.statistics.metrics.actuator_metrics import ActuatorEnergy as ActuatorEnergy
from lgvi_warp.statistics.metrics.actuator_metrics import CustomMetric as CustomMetric
from lgvi_warp.statistics.metrics.actuator_metrics import Effort as Effort
from lgvi_warp.statistics.metrics.actuator_metrics import ElectricalEnergy as ElectricalEnergy
from lgvi_warp.statistics.metrics.actuator_metrics import SaturationShare as SaturationShare
from lgvi_warp.statistics.metrics.actuator_metrics import TimeToFailure as TimeToFailure
from lgvi_warp.statistics.metrics.actuator_metrics import Travel as Travel
from lgvi_warp.statistics.metrics.dock_contact import DockContact as DockContact
from lgvi_warp.statistics.metrics.navigation_error import NavigationError as NavigationError
from lgvi_warp.statistics.metrics.nearest import Nearest as Nearest
from lgvi_warp.statistics.metrics.tracking_metrics import IAE as IAE
from lgvi_warp.statistics.metrics.tracking_metrics import ISE as ISE
from lgvi_warp.statistics.metrics.tracking_metrics import ITAE as ITAE
from lgvi_warp.statistics.metrics.tracking_metrics import CrossTrack as CrossTrack
from lgvi_warp.statistics.metrics.tracking_metrics import MaxError as MaxError
from lgvi_warp.statistics.metrics.tracking_metrics import Overshoot as Overshoot
from lgvi_warp.statistics.metrics.tracking_metrics import Peak as Peak
from lgvi_warp.statistics.metrics.tracking_metrics import PeakTime as PeakTime
from lgvi_warp.statistics.metrics.tracking_metrics import RiseTime as RiseTime
from lgvi_warp.statistics.metrics.tracking_metrics import RMSError as RMSError
from lgvi_warp.statistics.metrics.tracking_metrics import SettlingTime as SettlingTime
from lgvi_warp.statistics.metrics.tracking_metrics import SteadyStateError as SteadyStateError
from lgvi_warp.statistics.metrics.tracking_metrics import Undershoot as Undershoot
