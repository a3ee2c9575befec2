# SPDX-License-Identifier: Apache-2.0
"""Parts of a controller, one file each: sensors, guidance, laws, allocation and faults."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
