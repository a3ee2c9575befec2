# SPDX-License-Identifier: Apache-2.0
"""A vehicle as a co-simulation unit (FMU) of the FMI standard: its variables, its steps, and its file."""
