# SPDX-License-Identifier: Apache-2.0
"""Environment that JAX needs before it starts: the widest registers, and fused multiply-adds allowed."""

import os

FLAGS = ("--xla_cpu_prefer_vector_width=512", "--xla_cpu_enable_fast_math=true")
os.environ["XLA_FLAGS"] = " ".join([os.environ.get("XLA_FLAGS", ""), *FLAGS]).strip()
