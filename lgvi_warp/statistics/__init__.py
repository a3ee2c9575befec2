# SPDX-License-Identifier: Apache-2.0
"""Statistics over members, gathered while a run goes: one module for each kind, a table of them for scene files."""

import sys

from lgvi_warp.common import registry
from lgvi_warp.statistics.base import TYPES as TYPES

registry.load_modules(sys.modules[__name__])
