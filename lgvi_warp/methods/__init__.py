# SPDX-License-Identifier: Apache-2.0
"""Time integration methods as data: programs of sub-maps, tableaux, the time grid and stable steps."""
