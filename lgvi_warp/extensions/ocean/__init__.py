# SPDX-License-Identifier: Apache-2.0
"""The ocean as data sets give it: places on the Earth, axes of files in the CF conventions."""
