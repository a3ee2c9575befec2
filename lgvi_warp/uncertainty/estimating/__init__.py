# SPDX-License-Identifier: Apache-2.0
"""One statistic at the error asked for, for the least work."""
