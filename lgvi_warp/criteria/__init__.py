# SPDX-License-Identifier: Apache-2.0
"""Criteria that a study applies to members: kept metrics, success, risk; answers in files."""
