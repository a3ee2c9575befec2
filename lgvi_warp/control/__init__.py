# SPDX-License-Identifier: Apache-2.0
"""What a controller is made of, one file each: sensors, guidance, laws, allocation and faults."""

from __future__ import annotations

import sys

from lgvi_warp.common import registry

# Every part is an attribute of this package, and known by its type.
registry.load_modules(sys.modules[__name__])
