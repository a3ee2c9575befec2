# SPDX-License-Identifier: Apache-2.0
"""Probability distributions of single numbers and of whole quantities, and their names in scene files."""
