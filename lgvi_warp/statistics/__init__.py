# SPDX-License-Identifier: Apache-2.0
"""Statistics over members, gathered while a run goes: one module for each kind, a table of them for scene files."""

import sys

from lgvi_warp.common import registry
from lgvi_warp.common.doors import names_in_stub

registry.load_modules(sys.modules[__name__])

__all__, __getattr__, __dir__ = names_in_stub(__name__)
