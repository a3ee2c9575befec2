# SPDX-License-Identifier: Apache-2.0
"""Lanes that carry derivatives: each number with its slopes by one or two numbers of the scene, beside the plain lanes."""
