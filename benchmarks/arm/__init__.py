# SPDX-License-Identifier: Apache-2.0
"""Kernels compiled for 64-bit ARM, run by an emulated core on this process's memory, and their operations counted."""
