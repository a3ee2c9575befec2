# SPDX-License-Identifier: Apache-2.0
"""Variation from member to member: designs that fill the unit cube, and distributions that turn its levels into values."""
