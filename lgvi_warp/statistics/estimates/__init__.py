# SPDX-License-Identifier: Apache-2.0
"""Results of statistics: estimates with intervals, tables, quantile sketches, and comparisons."""
