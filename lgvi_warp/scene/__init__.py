# SPDX-License-Identifier: Apache-2.0
"""Scenes: what is simulated, what varies from member to member, and the files that describe both."""
