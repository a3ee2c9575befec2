# SPDX-License-Identifier: Apache-2.0
"""The site: its reference has every public name with each parameter, its pages are whole, its links lead somewhere."""

import dataclasses
import functools
import html.parser
import inspect
import operator
import os
import re
import subprocess
import sys
import tomllib
import urllib.parse
from pathlib import Path

import pytest

import lgvi_warp as lw
from lgvi_warp.cli.command import VERBS
from lgvi_warp.physics.terms.base import word_of
from lgvi_warp.scene.scene import SECTIONS
from tests.conftest import ROOT
from tests.support.public import PATHS, WHOLE

sys.path.append(str(ROOT / "docs"))

from site_parts import documented, order, pages

NAMES = [name for names in pages.groups().values() for name in names]


def undescribed(path, subject):
    """Parameters of a class or function, and of its public methods, that no docstring describes."""
    faults = [f"{path}: {item.name}" for item in documented.parameters(subject) if not item.text]
    for name in documented.methods(subject) if inspect.isclass(subject) else ():
        method = getattr(subject, name)
        if inspect.isfunction(method) or inspect.ismethod(method):
            faults += undescribed(f"{path}.{name}", method)
    return faults


class Base:
    """A class.

    Args:
        told: The inherited one,
            in two lines.
    """

    def __init__(self, told: int, silent: float = 1.0):
        pass


class Heir(Base):
    """Another.

    Args:
        a, b: Two [m].
        told: As in `Base`; and more.

    Returns:
        silent: no parameter.
    """

    def __init__(self, told: int, silent: float, a=(), *, b: "lw.Scene | None" = None):
        pass

    def method(self, x, *rest):
        """Does something.

        Args:
            x: Any.
        """


def test_the_check_sees_what_is_not_described():
    assert undescribed("Heir", Heir) == ["Heir: silent", "Heir.method: rest"]
    told, _, a, b = documented.parameters(Heir)
    assert told.text == "The inherited one, in two lines; and more."
    assert told.note == "int; required"
    assert (a.text, b.text) == ("Two [m].",) * 2
    assert a.note == "default ()"
    assert b.note == "lw.Scene | None; default None"


@pytest.mark.parametrize(
    "name", sorted([*PATHS, *(f"{door}.{name}" for door in WHOLE for name in getattr(lw, door).__all__)])
)
def test_each_parameter_is_described(name):
    assert name in NAMES, f"lw.{name} has no row in docs/reference/api.md"
    subject = operator.attrgetter(name)(lw)
    assert not undescribed(name, subject)


def test_numbers_have_shape_and_unit():
    notes = {item.name: item.note for item in documented.parameters(lw.terms.Thrusters)}
    assert notes["position"] == "numbers, shape (n, 3) [m]; required"
    assert {item.name: item.note for item in documented.parameters(lw.terms.Tether)}[
        "rest_length"
    ] == "number [m]; default 0.0"


def test_text_is_shown_as_it_stands():
    assert pages.escaped("* |v| of `x`s, a*b, lambda_\n  * c") == "* \\|v\\| of \\ ``x``\\ s, a\\*b, lambda\\_\n  * c"
    assert pages.linked("Scene | Scenes") == "\\ :py:obj:`Scene <lgvi_warp.Scene>`\\  \\| Scenes"


def keys_of(text):
    """First cells of the rows of a table, without its head."""
    return sorted(re.findall(r"^   \* - ``(\w+)``", text, re.MULTILINE))


def test_each_section_and_type_of_the_scene_file_has_its_keys():
    parts = re.split(r"^(\[.*)\n-+\n", pages.scene_file_page(), flags=re.MULTILINE)
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    assert sections.keys() == pages.SECTIONS.keys() | pages.TYPES.keys()
    named = {name.strip("[]").partition(".")[0].partition("]")[0] for name in sections}
    assert named == set(SECTIONS) - {"source"}  # which is not read
    for title, kind in pages.SECTIONS.items():
        assert keys_of(sections[title]) == sorted(item.name for item in dataclasses.fields(kind) if item.init)
    for title, kinds in pages.TYPES.items():
        types = re.split(r"^``(\w+)``\n~+\n", sections[title], flags=re.MULTILINE)
        keys = {word: keys_of(text) for word, text in zip(types[1::2], types[2::2], strict=True)}
        fields = {word: documented.fields_of(kind) for word, kind in kinds.items() if "lgvi_warp" in kind.__module__}
        assert keys == {
            word: sorted(word_of(item) for item in found.values() if item.init) for word, found in fields.items()
        }


def test_each_verb_has_its_help():
    verbs = re.findall(r"^   usage: lgvi-warp ([a-z-]+)", pages.command_page(), re.MULTILINE)
    assert sorted(verbs) == sorted(VERBS.keys() - {"plan"})  # the old name of predict


def test_every_page_is_in_the_table_of_contents_once():
    text = (ROOT / "docs" / "pages.md").read_text()
    listed = [page for rows in order.captions(text).values() for _, _, page in rows]
    assert sorted(set(listed)) == sorted(listed)
    shown = order.side_bar(text) + "".join(order.contents(entries) for entries in order.below(text).values())
    assert sorted(re.findall(r" </([\w/]+)>$", shown, re.MULTILINE)) == sorted(listed)
    sources = [page for kind in ("*.md", "*.ipynb") for page in (ROOT / "docs").rglob(kind)]
    written = {str(page.relative_to(ROOT / "docs").with_suffix("")) for page in sources}
    below = {name for name in written if re.match("guide/terms/[a-z]|reference/built/", name)}
    assert {name for name in listed if "/built/" not in name} == written - below - {"index", "pages"}


def test_notebooks_are_beside_the_guides_of_their_topic():
    captions = order.captions((ROOT / "docs" / "pages.md").read_text())
    assert len(captions) == 10
    with_notebooks = {
        caption: sum(page.startswith("notebooks/") for _, _, page in rows) for caption, rows in captions.items()
    }
    assert sum(with_notebooks.values()) == len(list((ROOT / "docs" / "notebooks").glob("*.ipynb")))
    assert all(count < len(captions[caption]) / 2 for caption, count in with_notebooks.items())


def test_pages_below_others_and_captions_become_tables_of_contents():
    text = "# All\n\n## One\n\n* [A](a.md)\n  * [B](x/b.md)\n* [C](../CHANGELOG.md)\n\n## Two\n\n* [D](d.ipynb)\n"
    assert order.below(text) == {"a": ["B </x/b>"]}
    tables = re.findall(r"```{toctree}\n:hidden:\n:caption: (\w+)\n\n(.*?)\n```\n", order.side_bar(text), re.DOTALL)
    assert tables == [("One", "A </a>\nC </reference/built/changelog>"), ("Two", "D </d>")]
    assert order.contents([]) == ""


def test_the_first_page_has_six_cards_and_no_other_links():
    text = order.ON_GITHUB.sub("", (ROOT / "docs" / "index.md").read_text())
    cards = re.findall(
        r"^````{grid-item-card} .*\n((?::[a-z-]+: .*\n)+)\n((?:.+\n)+)````\n", order.landing(text), re.MULTILINE
    )
    assert len(cards) == 6
    for options, paragraph in cards:
        found = dict(re.findall(r"^:([a-z-]+): (.+)$", options, re.MULTILINE))
        assert found.keys() == {"link", "link-type", "img-top", "img-alt"}
        assert (ROOT / "docs" / f"{found['link']}.md").exists()
        assert (ROOT / "docs" / found["img-top"]).exists()
        assert len(paragraph.split()) > 15
    assert re.findall(r"(?<!!)\[[^\]]+\]\(", order.landing(text)) == []


def test_words_to_search_for_become_entries_of_the_index():
    text = "# Title\n\nText.\n\n<!-- search: lawn mower, survey -->\n"
    first, second = "```{index} ! lawn mower\n```\n", "```{index} ! survey\n```\n"
    assert order.indexed(text) == f"# Title\n\n{first}\n{second}\nText.\n\n"
    assert order.indexed("# Title\n\nText.\n") == "# Title\n\nText.\n"


def test_a_signature_shows_what_each_call_makes_anew():
    @dataclasses.dataclass
    class Fleet:
        members: int = 1
        terms: list = dataclasses.field(default_factory=lambda: [1.0, 2.0])

    assert pages.signature(Fleet, "(members=1, terms=<factory>)") == "(members=1, terms=[1.0, 2.0])"
    assert pages.signature(lw.solve, "(fleet, h=None)") == "(fleet, h=None)"
    assert pages.signature(lw.laws.number, "(default=<x.y object at 0x7f>)") == "(default=...)"
    assert "Estimates" not in pages.signature(lw.Result, "(statistics=<factory>, jacobian=<factory>)")


class Page(html.parser.HTMLParser):
    """The links, and the places where links may lead to, of a page of the site."""

    def __init__(self, path):
        super().__init__()
        self.links, self.places = [], set()
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.places.add(found.get("id"))
        self.links += [found[name] for name in ("href", "src") if found.get(name)]


def broken_links(site):
    """Links of a folder of HTML pages that lead to no file, or to no place of its page; and pages from elsewhere."""
    page_at, faults = functools.cache(Page), []
    for path in sorted(site.rglob("*.html")):
        for link in page_at(path).links:
            parts = urllib.parse.urlsplit(link)
            goal = (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path
            anchor = urllib.parse.unquote(parts.fragment)
            if parts.scheme or parts.netloc:
                continue
            if not goal.exists() or (anchor and goal.suffix == ".html" and anchor not in page_at(goal).places):
                faults.append(f"{path.relative_to(site)}: {link}")
    return faults


def test_broken_links_are_found(tmp_path):
    (tmp_path / "a.html").write_text('<p id="x"><a href="b.html#y"></a><a href="#x"></a><a href="https://x.y/z"></a>')
    (tmp_path / "b.html").write_text('<a href="a.html#no"></a><a href="#y"></a><img src="no.png"><a href="a.html"></a>')
    assert broken_links(tmp_path) == ["a.html: b.html#y", "b.html: a.html#no", "b.html: #y", "b.html: no.png"]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Output of the build, and the folder of the site."""
    pytest.importorskip("sphinx")
    folder = tmp_path_factory.mktemp("site")
    site = folder / "html"
    # No network: a name that is looked up has no server.
    offline = os.environ | {name: "http://127.0.0.1:9" for name in ("http_proxy", "https_proxy")}
    offline |= {"LGVI_WARP_SITES": f"{lw.__version__} 0.0.1"}
    command = [
        sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", str(folder / "trees"), "docs", str(site),
    ]  # fmt: skip
    return subprocess.run(command, cwd=ROOT, env=offline, capture_output=True, text=True), site


@pytest.mark.slow
def test_the_site_is_built_without_warnings_and_its_links_lead_somewhere(built):
    done, site = built
    assert done.returncode == 0, done.stderr
    # The other version is beside this one.
    assert {fault.rpartition(" ")[2].replace("../", "") for fault in broken_links(site)} <= {"0.0.1/", "./0.0.1/"}
    text = "".join(Path(page).read_text() for page in (site / "reference" / "built").glob("*.html"))
    missing = [
        name
        for name in NAMES
        if not inspect.ismodule(operator.attrgetter(name)(lw)) and f'id="lgvi_warp.{name}"' not in text
    ]
    assert not missing


@pytest.mark.slow
def test_pages_say_their_version_and_where_to_edit_them(built):
    source = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["urls"]["Source"]
    for name in ("index.md", "guide/your_vehicle.md", "theory/water.md"):
        page = (built[1] / name).with_suffix(".html").read_text()
        assert f'href="{source}/edit/main/docs/{name}"' in page
        assert re.search(rf'version {re.escape(lw.__version__)} · <a href="[./]*/0\.0\.1/">', page)
        assert "copybutton.js" in page


@pytest.mark.slow
def test_the_first_page_has_six_cards_with_pictures_and_links(built):
    page = (built[1] / "index.html").read_text()
    cards = re.split(r'class="sd-card sd-', page)[1:]
    assert len(cards) == 6
    for card in cards:
        assert re.search(r'<img alt="[^"]+"', card)
        assert re.search(r'class="sd-stretched-link[^>]*href="(guide|develop)/\w+\.html"', card)


@pytest.mark.slow
def test_signatures_show_defaults(built):
    def signature(page, name):
        text = (built[1] / "reference" / "built" / f"{page}.html").read_text()
        entry = re.search(rf'<dt [^>]*id="lgvi_warp\.{re.escape(name)}">(.*?)</dt>', text, re.DOTALL)
        return "".join(re.sub(r"<[^>]+>", "", entry[1]).split())

    assert "h=None,t1=None" in signature("run", "solve")
    assert "relative_error=0.1,by='chains'" in signature("ask", "rare_event")
    assert "linear=(0.0,0.0,0.0,0.0,0.0,0.0)" in signature("terms", "terms.Drag")
    assert "environment=Environment()" in signature("describe", "Scene")
