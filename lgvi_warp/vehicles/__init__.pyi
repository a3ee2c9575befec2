# SPDX-License-Identifier: Apache-2.0
# The public names of this door, one a line.

from lgvi_warp.extensions.importers.sdf import from_sdf as from_sdf
from lgvi_warp.extensions.importers.yaml import from_yaml as from_yaml
from lgvi_warp.vehicles.fossen import from_fossen as from_fossen
from lgvi_warp.vehicles.fossen import vehicle_names as names
