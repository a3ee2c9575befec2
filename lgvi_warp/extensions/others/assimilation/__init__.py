# SPDX-License-Identifier: Apache-2.0
"""Assimilation: members that follow what was measured, and learn numbers on the way."""
