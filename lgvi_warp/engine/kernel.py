# SPDX-License-Identifier: Apache-2.0
"""The kernel of a run: made at its first use, since many plans are never run, and loaded once per process."""

from __future__ import annotations

import contextlib
import functools
import time
from collections.abc import Iterator

import numpy as np

from lgvi_kernels.advance.kernel import Advance, make_advance
from lgvi_kernels.advance.spec import Spec
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.phases import Phases
from lgvi_warp.common.sentences import sentences
from lgvi_warp.common.warp_setup import build_lock
from lgvi_warp.control.base import Part
from lgvi_warp.engine import kernel_cache
from lgvi_warp.engine.kernel_choice import KernelChoice, is_built_in


class Kernel:
    """A kernel and its types; phases: durations of `load`, zeros if this process had already loaded the kernel."""

    def __init__(self, spec: Spec, choice: KernelChoice):
        self._spec, self._choice = spec, choice
        self.phases = Phases()

    @functools.cached_property
    def advance(self) -> Advance:
        """The kernel function for launches."""
        with build_lock, self._laws_compile():
            return make_advance(self._spec)

    @property
    def hash(self) -> str:
        """Hash in Warp's cache, of source, constants and compiler options, in hexadecimal digits."""
        return str(self.advance.kernel.module.get_module_hash().hex())

    @property
    def dtypes(self) -> tuple[np.dtype, ...]:
        """NumPy dtypes of the structs Inertia, Params, Events and Limits, and of Loop with a controller."""
        return _dtypes(self.advance)

    def load(self) -> None:
        """Load the kernel, and compile it first if Warp's cache does not have it."""
        start = time.perf_counter()
        module = self.advance.kernel.module
        if module in kernel_cache.loaded:
            return
        source_seconds = time.perf_counter() - start
        with self._laws_compile():
            phases = kernel_cache.load(module)
        if any(phases):  # no other thread loaded it meanwhile
            self.phases = phases._replace(source=source_seconds + phases.source)

    @contextlib.contextmanager
    def _laws_compile(self) -> Iterator[None]:
        """Turn an exception raised while a user's law compiles into a SceneError that names the law."""
        try:
            yield
        except OSError:  # of the kernel cache
            raise
        except Exception as error:
            choice = self._choice
            acting = (*choice.laws, *choice.events, *choice.parts_of_control)
            of_user = [term for term, module in acting if not is_built_in(module)]
            if not of_user:
                raise
            problem = f"one of them does not compile ({type(error).__name__}: {error})"
            remedies = {
                False: "lw.laws.check_law(term) says where, docs/develop/add_a_force.md how",
                True: "lw.laws.check_controller(part) says where, docs/develop/add_a_controller.md how",
            }
            remedy = " and ".join(remedies[kind] for kind in sorted({isinstance(term, Part) for term in of_user}))
            raise SceneError([sentences(f"law {', '.join(term.key for term in of_user)}", problem, remedy)]) from error


@functools.lru_cache(maxsize=256)
def _dtypes(advance: Advance) -> tuple[np.dtype, ...]:
    """Types of a kernel, cached, since many plans share a kernel and Warp takes long to compute them."""
    types = advance.types
    kinds = (types.Inertia, types.Params, types.Events, types.Limits, *([types.Loop] if types.Loop else []))
    return tuple(np.dtype(kind.numpy_dtype()) for kind in kinds)
