# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.physics.public_notation import cross as cross
from lgvi_warp.physics.public_notation import hat as hat
from lgvi_warp.physics.public_notation import matrix_from_euler_deg as matrix_from_euler_deg
from lgvi_warp.physics.public_notation import matrix_from_quaternion as matrix_from_quaternion
from lgvi_warp.physics.public_notation import matrix_from_rotation_vector as matrix_from_rotation_vector
from lgvi_warp.physics.public_notation import off_diagonal as off_diagonal
from lgvi_warp.physics.public_notation import principal_axes as principal_axes
from lgvi_warp.physics.public_notation import quaternion_from_matrix as quaternion_from_matrix
from lgvi_warp.physics.public_notation import repeated as repeated
from lgvi_warp.physics.public_notation import rotate_into as rotate_into
from lgvi_warp.physics.public_notation import rotate_out as rotate_out
from lgvi_warp.physics.public_notation import rotations as rotations
from lgvi_warp.physics.public_notation import to_momenta as to_momenta
