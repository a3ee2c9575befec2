# SPDX-License-Identifier: Apache-2.0
"""Derivatives of the outputs of whole runs, by differences of copies of members that run side by side."""
