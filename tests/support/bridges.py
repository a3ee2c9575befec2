# SPDX-License-Identifier: Apache-2.0
"""The examples of bridges as modules."""

import importlib.util
import sys

from tests.conftest import ROOT


def example(name):
    """An example of examples/bridges, by its file's name; what it defines can be pickled."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / "bridges" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
