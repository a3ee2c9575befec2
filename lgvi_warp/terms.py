# SPDX-License-Identifier: Apache-2.0
"""Forces and other terms that act on a vehicle, for `Scene(terms=[...])`."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
