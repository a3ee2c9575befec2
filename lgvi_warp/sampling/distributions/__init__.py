# SPDX-License-Identifier: Apache-2.0
"""Probability distributions of what varies: of single numbers, of whole quantities, and by their names in a scene file."""
