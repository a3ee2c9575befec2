# SPDX-License-Identifier: Apache-2.0
"""Events too rare to see by plain sampling: chains of members, and weights from those that fail."""
