# SPDX-License-Identifier: Apache-2.0
"""Values that statistics are of: samples of a block, quantities, expressions, and signals of a loop."""
