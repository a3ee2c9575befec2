# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.control.altimeter import Altimeter as Altimeter
from lgvi_warp.control.altitude import Altitude as Altitude
from lgvi_warp.control.bounded_least_squares import BoundedLeastSquares as BoundedLeastSquares
from lgvi_warp.control.callback import Callback as Callback
from lgvi_warp.control.complementary_filter import ComplementaryFilter as ComplementaryFilter
from lgvi_warp.control.dead_reckoning import DeadReckoning as DeadReckoning
from lgvi_warp.control.depth_pid import DepthPID as DepthPID
from lgvi_warp.control.docking import Docking as Docking
from lgvi_warp.control.fault import Fault as Fault
from lgvi_warp.control.heading_pid import HeadingPID as HeadingPID
from lgvi_warp.control.heading_smc import HeadingSMC as HeadingSMC
from lgvi_warp.control.heave_pid import HeavePID as HeavePID
from lgvi_warp.control.loiter import Loiter as Loiter
from lgvi_warp.control.low_pass import LowPass as LowPass
from lgvi_warp.control.matrix import AllocationMatrix as AllocationMatrix
from lgvi_warp.control.policy import Policy as Policy
from lgvi_warp.control.pose_pid import PosePID as PosePID
from lgvi_warp.control.pose_smc import PoseSMC as PoseSMC
from lgvi_warp.control.pseudo_inverse import PseudoInverse as PseudoInverse
from lgvi_warp.control.reference_model import ReferenceModel as ReferenceModel
from lgvi_warp.control.sensor import Sensor as Sensor
from lgvi_warp.control.set_point import SetPoint as SetPoint
from lgvi_warp.control.speed_pid import SpeedPID as SpeedPID
from lgvi_warp.control.state_feedback import StateFeedback as StateFeedback
from lgvi_warp.control.trajectory import Trajectory as Trajectory
from lgvi_warp.control.waypoints import Waypoints as Waypoints
from lgvi_warp.engine.host_callback import CallbackInput as CallbackInput
from lgvi_warp.extensions.navigation.control.dvl import DVL as DVL
from lgvi_warp.extensions.navigation.control.error_state_filter import ErrorStateFilter as ErrorStateFilter
from lgvi_warp.extensions.navigation.control.imu import IMU as IMU
from lgvi_warp.extensions.others.control.linear_mpc import LinearMPC as LinearMPC
