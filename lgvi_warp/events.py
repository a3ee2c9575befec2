# SPDX-License-Identifier: Apache-2.0
"""Events, the conditions that stop a member, for `Scene(events=[...])`."""

from lgvi_warp.common.doors import names_in_stub

__all__, __getattr__, __dir__ = names_in_stub(__name__)
