# SPDX-License-Identifier: Apache-2.0
"""Results of a run: samples, status and fields of each member, provenance, and result files."""
