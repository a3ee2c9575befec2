# SPDX-License-Identifier: Apache-2.0
"""A vehicle as a unit of the FMI standard: its variables, its steps, and the file that holds both."""
