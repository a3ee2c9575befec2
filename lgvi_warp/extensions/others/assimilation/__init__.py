# SPDX-License-Identifier: Apache-2.0
"""Data assimilation: filters correct members by measurements and estimate numbers of the scene."""
