# SPDX-License-Identifier: Apache-2.0
"""Variation of members: designs that fill the unit cube, and distributions that turn its levels into values."""
