# SPDX-License-Identifier: Apache-2.0
"""Checks of a law's device code against finite differences, linear algebra and the host code of its term."""
