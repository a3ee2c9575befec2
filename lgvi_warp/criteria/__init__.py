# SPDX-License-Identifier: Apache-2.0
"""Criteria that a study applies to members: stored metrics, success, risk; files of answers."""
