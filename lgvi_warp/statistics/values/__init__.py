# SPDX-License-Identifier: Apache-2.0
"""Values for statistics: samples of a block, quantities, expressions, and signals of a loop."""
