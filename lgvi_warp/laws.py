# SPDX-License-Identifier: Apache-2.0
"""Imports of an author of device code: bases of terms and of parts of a controller, and the checks of both."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
