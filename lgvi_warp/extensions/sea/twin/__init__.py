# SPDX-License-Identifier: Apache-2.0
"""The NumPy twin, for tests and readers."""
