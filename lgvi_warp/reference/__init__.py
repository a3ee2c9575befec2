# SPDX-License-Identifier: Apache-2.0
"""The NumPy twin of lgvi_kernels: one vehicle, float64, plain rotation matrices, numpy only.

Same file and function names as the kernels, the paper's symbols, one function for each printed equation.
"""
