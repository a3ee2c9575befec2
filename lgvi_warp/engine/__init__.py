# SPDX-License-Identifier: Apache-2.0
"""The engine: chooses a kernel for a scene, packs members into lanes, and runs them block by block."""
