# SPDX-License-Identifier: Apache-2.0
"""Controllers: parts against their twins, closed loops, analytic answers."""
