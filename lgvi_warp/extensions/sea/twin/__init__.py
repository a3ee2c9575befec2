# SPDX-License-Identifier: Apache-2.0
"""The NumPy twin of the device code, for tests and readers."""
