# SPDX-License-Identifier: Apache-2.0
"""What users call to run an ensemble: solve, prepare, predict, resume, merge and warm."""
