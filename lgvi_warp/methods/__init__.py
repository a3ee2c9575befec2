# SPDX-License-Identifier: Apache-2.0
"""How time advances, as data: programs of sub-maps, tableaux, the time grid and stable steps."""
