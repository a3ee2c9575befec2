# SPDX-License-Identifier: Apache-2.0
"""One file for each comparison with a published experiment or code; `python -m benchmarks table validation` runs them."""
