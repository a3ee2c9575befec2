# SPDX-License-Identifier: Apache-2.0
"""The physics of one vehicle: inertia, the forces that act on it, energy, and conventions of axes and attitudes."""
