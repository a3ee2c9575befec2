# SPDX-License-Identifier: Apache-2.0
"""The physics of one vehicle: inertia, forces, energy, and conventions of axes and attitudes."""
