# SPDX-License-Identifier: Apache-2.0
"""What statistics end as: estimates with intervals, tables of them, sketches, and comparisons."""
