# SPDX-License-Identifier: Apache-2.0
"""Pictures and recordings of results and studies."""
