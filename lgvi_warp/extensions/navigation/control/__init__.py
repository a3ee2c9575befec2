# SPDX-License-Identifier: Apache-2.0
"""Parts of a controller for inertial navigation, one file each."""
