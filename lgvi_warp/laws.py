# SPDX-License-Identifier: Apache-2.0
"""Names for authors of device code: base classes of terms and of parts of a controller, and checks for both."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
