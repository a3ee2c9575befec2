# SPDX-License-Identifier: Apache-2.0
"""Terms of gliders, one file each."""
