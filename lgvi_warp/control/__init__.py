# SPDX-License-Identifier: Apache-2.0
"""What a controller is made of, one file each: sensors, guidance, laws, allocation and faults."""

from __future__ import annotations

import sys

from lgvi_warp.common import registry
from lgvi_warp.common.doors import names_in_stub

# Every part is an attribute of this package, and known by its type.
registry.load_modules(sys.modules[__name__])

__all__, __getattr__, __dir__ = names_in_stub(__name__)
