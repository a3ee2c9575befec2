# SPDX-License-Identifier: Apache-2.0
"""Events too rare for plain sampling: subset simulation by chains, and importance sampling."""
