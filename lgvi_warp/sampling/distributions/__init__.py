# SPDX-License-Identifier: Apache-2.0
"""Probability distributions of what varies: of single numbers, of whole quantities, and by their names in a scene file."""

import sys

from lgvi_warp.common import registry

registry.load_modules(sys.modules[__name__])
