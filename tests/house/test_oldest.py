# SPDX-License-Identifier: Apache-2.0
"""The constraints of the oldest versions are the lower bounds of pyproject.toml.

`python -m tests.house.test_oldest` writes .ci/oldest.txt anew. The workflow runs the unit tests with these versions.
"""

import re
import tomllib

import pytest
from packaging.requirements import Requirement

from tests.conftest import ROOT

FILE = ROOT / ".ci" / "oldest.txt"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
HEAD = (
    "# The oldest versions that pyproject.toml allows. Written by `python -m tests.house.test_oldest`; do not edit.\n"
)


def needed(texts):
    """Requirements of other packages: those of the package's own extras stand for what they name."""
    for requirement in map(Requirement, texts):
        if requirement.name == PROJECT["name"]:
            for extra in requirement.extras:
                yield from needed(PROJECT["optional-dependencies"][extra])
        else:
            yield requirement


def oldest(texts):
    """{name: lower bound} of requirements."""
    bounds = {}
    for requirement in needed(texts):
        (bound,) = (part.version for part in requirement.specifier if part.operator == ">=")
        assert bounds.setdefault(requirement.name, bound) == bound, f"{requirement.name}: two lower bounds"
    return bounds


def content():
    """The file as it should be."""
    bounds = oldest([*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["test"]])
    return HEAD + "".join(f"{name}=={bounds[name]}\n" for name in sorted(bounds, key=str.lower))


def test_the_file_has_each_lower_bound():
    assert FILE.read_text() == content(), "run: python -m tests.house.test_oldest"
    assert len(content().splitlines()) > 30


@pytest.mark.parametrize("extra", PROJECT["optional-dependencies"])
def test_every_requirement_has_a_lower_bound(extra):
    assert oldest(PROJECT["optional-dependencies"][extra])


def test_the_workflow_installs_them_with_the_oldest_python():
    job = re.search(r"\n  oldest:\n(?:    .*\n)+", (ROOT / ".github" / "workflows" / "ci.yml").read_text())[0]
    assert f'python-version: "{PROJECT["requires-python"].removeprefix(">=")}"' in job
    assert "--constraint .ci/oldest.txt" in job


if __name__ == "__main__":
    FILE.write_text(content())
