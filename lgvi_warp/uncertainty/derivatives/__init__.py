# SPDX-License-Identifier: Apache-2.0
"""Derivatives of what whole runs give, by differences of copies of members that run side by side."""
