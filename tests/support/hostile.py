# SPDX-License-Identifier: Apache-2.0
"""Stores, results, studies and sweeps that somebody made to do harm, or that were damaged: built from a good one, each by one
function."""

import json
import os
import pickle
import socket
import struct
import zipfile

import numpy as np

from lgvi_warp.store import folder as store
from lgvi_warp.store.block_files import marker, read_marker

ROOT = "zarr.json"
TEXTS = ("provenance", "recipe", "messages", "shared")


class Payload:
    """Pickled, it writes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def said(path):
    """What a store's root says, with its texts read."""
    content = json.loads((path / ROOT).read_text())
    for name in TEXTS:
        content["attributes"][name] = json.loads(content["attributes"][name])
    return content


def say(path, content):
    """Write it, with checksums that fit."""
    attributes = content["attributes"]
    for name in TEXTS:
        if not isinstance(attributes.get(name), str):
            attributes[name] = json.dumps(attributes.get(name))
    attributes["crc32c"] = store.checksum_of([attributes[name] for name in TEXTS])
    (path / ROOT).write_text(json.dumps(content))


def text(*keys, value):
    """One of the texts of a store has another value, and the checksums fit: consistent, but wrong."""

    def harm(path, home):
        content = said(path)
        table = content["attributes"]
        for key in keys[:-1]:
            table = table[key]
        table[keys[-1]] = value(home) if callable(value) else value
        say(path, content)

    return harm


def array(name, **changes):
    """The metadata of an array is another one."""

    def harm(path, home):
        content = said(path)
        arrays = content["consolidated_metadata"]["metadata"]
        arrays[name] = arrays.get(name, dict(arrays["status"])) | changes
        say(path, content)

    return harm


def lacks(name):
    def harm(path, home):
        content = said(path)
        del content["consolidated_metadata"]["metadata"][name]
        say(path, content)

    return harm


def marks(key, size=6, crc=0, file="blocks/000000000.json"):
    """A marker, or the list of the frame's files, names another file too, and its checksum fits."""

    def harm(path, home):
        sums = read_marker(path, file)
        name = key.format(home=home)
        target = path / name if "\0" not in name else home / "notes.txt"
        if crc is None and target.is_file():
            data = target.read_bytes()
            sums[name] = [len(data), store.durable.checksum(data)]
        else:
            sums[name] = [size, crc]
        (path / file).write_bytes(marker(sums))

    return harm


def lists(key, size=6, crc=0):
    return marks(key, size, crc, "created.json")


def link(name, to):
    """A link in the place of a file or folder; to: below the user's folder, or a path."""

    def harm(path, home):
        move(path / name, home.parent / "moved")
        (path / name).symlink_to(to if to.startswith("/") else home / to)

    return harm


def move(one, other):
    if os.path.lexists(one):
        one.rename(other)


def special(name, make):
    """A pipe, socket or folder in the place of a file."""

    def harm(path, home):
        (path / name).unlink(missing_ok=True)
        make(path / name)

    return harm


def bound(path):
    """A socket; its path must be short."""
    here = os.getcwd()
    os.chdir(path.parent)
    try:
        socket.socket(socket.AF_UNIX).bind(path.name)
    finally:
        os.chdir(here)


def content(name, data):
    """A file with other bytes; data: what they are, of the user's folder."""

    def harm(path, home):
        (path / name).write_bytes(data(home) if callable(data) else data)

    return harm


def often(name, size, count):
    """A file of so many zeros, and links to it beside it."""

    def harm(path, home):
        sized(name, size)(path, home)
        for i in range(count):
            (path / f"{i}{name}").symlink_to(name)

    return harm


def sized(name, size):
    """A file of so many zeros, which take no room."""

    def harm(path, home):
        with (path / name).open("wb") as file:
            file.truncate(size)

    return harm


def parts(data):
    """Other parts of a block, whose checksum fits."""

    def harm(path, home):
        found = data(home) if callable(data) else data
        (path / "parts" / "000000000.npy").write_bytes(found)
        marker_file = path / "blocks" / "000000000.json"
        sums = read_marker(path, "blocks/000000000.json")
        sums["parts/000000000.npy"] = [len(found), store.durable.checksum(found)]
        marker_file.write_bytes(marker(sums))

    return harm


def chunk(name, values):
    """Other numbers in a chunk of the first block, whose checksums fit."""

    def harm(path, home):
        (file,) = (path / name).glob("c.0*")
        data = values.tobytes()
        data += store.durable.checksum(data).to_bytes(4, "little")
        file.write_bytes(data)
        marker_file = path / "blocks" / "000000000.json"
        sums = read_marker(path, "blocks/000000000.json")
        sums[f"{name}/{file.name}"] = [len(data), store.durable.checksum(data)]
        marker_file.write_bytes(marker(sums))

    return harm


def npy(described, data=b""):
    """An array in NumPy's format with any header."""
    header = described.encode().ljust(118 - 1) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + data


HUGE = "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000000,)}"
EMPTY_TYPE = "{'descr': '|V0', 'fortran_order': False, 'shape': (1000000000000000,)}"
OBJECT = "{'descr': '|O', 'fortran_order': False, 'shape': ()}"
WORD = "{'descr': '<U2', 'fortran_order': False, 'shape': ()}"
CALL = "{'descr': __import__('os').mkdir('called'), 'fortran_order': False, 'shape': ()}"


def pickled(home):
    return npy(OBJECT, pickle.dumps(Payload(home / "pickled")))


def deep(path, home):
    (path / ROOT).write_text("[" * 200_000)


def endless(path, home):
    """Folders within folders, far beyond a path's length."""
    here = os.getcwd()
    os.chdir(path)
    try:
        for _ in range(600):
            os.mkdir("deeper")
            os.chdir("deeper")
    finally:
        os.chdir(here)


def store_is_a_link(path, home):
    move(path, home / "run.zarr")
    path.symlink_to(home / "run.zarr")


CSV = {"table": {"file": "/dev/zero", "sha256": "0" * 64}}
CODECS = (
    ("blosc", [{"name": "bytes", "configuration": {"endian": "little"}}, {"name": "blosc", "configuration": {}}]),
    ("pickle", [{"name": "numcodecs.pickle", "configuration": {"protocol": 5}}]),
    ("sharding", [{"name": "sharding_indexed", "configuration": {"chunk_shape": [1]}}]),
    ("none", []),
)

# Each store: what it is called, how it is made, and what `lgvi-warp info` says of it.
STORES = {
    # Names that lead out of the folder, or that are no names.
    "created names a file above": (lists("../../home/notes.txt", crc=None), "does not fit the arrays"),
    "created names an absolute path": (lists("{home}/notes.txt", crc=None), "does not fit the arrays"),
    "created names a path that goes in and out": (lists("time/../../../home/notes.txt", crc=None), "does not fit"),
    "created names a NUL": (lists("time/c\0.0"), "does not fit the arrays"),
    "created names backslashes": (lists("..\\..\\home\\notes.txt"), "does not fit the arrays"),
    "created names a drive": (lists("C:/notes.txt"), "does not fit the arrays"),
    "created names 3000 letters": (lists("a" * 3000), "does not fit the arrays"),
    "created names itself": (lists("created.json"), "does not fit the arrays"),
    "created names nothing": (lists(""), "does not fit the arrays"),
    "created names a huge size": (lists("time/c.0", 10**18), "does not fit the arrays"),
    "created has a negative size": (lists("time/c.0", -1), "created.json is damaged"),
    "created has texts for sizes": (lists("time/c.0", "12"), "created.json is damaged"),
    "marker names a file above": (marks("../../home/notes.txt", crc=None), "is no file of it"),
    "marker names an absolute path": (marks("{home}/notes.txt", crc=None), "is no file of it"),
    "marker names the settings of a user": (marks("{home}/.ssh/config", crc=None), "is no file of it"),
    "marker names a path that goes in and out": (marks("status/../../../home/notes.txt", crc=None), "is no file of it"),
    "marker names a NUL": (marks("status/c\0.0"), "is no file of it"),
    "marker names backslashes": (marks("status\\c.0"), "is no file of it"),
    "marker names a drive": (marks("C:c.0"), "is no file of it"),
    "marker names another block's chunk": (marks("status/c.1", crc=None), "is no file of it"),
    "marker names another block's parts": (marks("parts/000000256.npy"), "is no file of it"),
    "marker names the root": (marks("zarr.json", crc=None), "is no file of it"),
    "marker names the terminal": (marks("\x1b[2Jstatus"), "is no file of it"),
    "marker has a huge size": (marks("status/c.0", 10**15), "bytes in the marker, not"),
    "marker is a list": (content("blocks/000000000.json", marker({})[:0] + b"[]\n00000000\n"), "not complete"),
    # Links and what is no file.
    "a chunk is a link": (link("status/c.0", "secret"), "is a link"),
    "a chunk is a link to zeros": (link("status/c.0", "/dev/zero"), "is a link"),
    "a chunk is a link into the store": (link("status/c.0", "../theirs/run.zarr/status/c.1"), "is a link"),
    "an array is a link": (link("status", "work"), "is a link"),
    "the markers are a link": (link("blocks", "work"), "is a link"),
    "the parts are a link": (link("parts", "work"), "is a link"),
    "a marker is a link": (link("blocks/000000000.json", "secret"), "is a link"),
    "the root is a link": (link("zarr.json", "secret"), "is a link"),
    "created is a link": (link("created.json", "secret"), "is a link"),
    "kept is a link": (link("kept", "work"), "is damaged"),
    "kept's root is a link": (link("kept/zarr.json", "secret"), "is damaged"),
    "a link leads nowhere": (link("status/c.0", "nothing"), "is a link"),
    "the store is a link": (store_is_a_link, "is a link; name the store"),
    "a chunk is a pipe": (special("status/c.0", os.mkfifo), "pipe"),
    "the root is a pipe": (special("zarr.json", os.mkfifo), "pipe"),
    "created is a pipe": (special("created.json", os.mkfifo), "pipe"),
    "a marker is a pipe": (special("blocks/000000000.json", os.mkfifo), "pipe"),
    "a chunk is a socket": (special("status/c.0", bound), "socket"),
    "a chunk is a folder": (special("status/c.0", os.mkdir), "is a folder"),
    "the root is a folder": (special("zarr.json", os.mkdir), "is a folder"),
    "folders without an end": (endless, "lies deeper"),
    # The root's metadata.
    "the root is empty": (content(ROOT, b""), "is damaged"),
    "the root is no text": (content(ROOT, bytes(range(256))), "is damaged"),
    "the root is a list": (content(ROOT, b"[]"), "is damaged"),
    "the root is half": (lambda path, home: os.truncate(path / ROOT, 3000), "is damaged"),
    "the root is nested without an end": (deep, "is damaged"),
    "the root has a number of 5000 digits": (content(ROOT, b'{"attributes":' + b"9" * 5000 + b"}"), "is damaged"),
    "the root has 50 GB": (sized(ROOT, 50 * 10**9), "is no file of a run"),
    "created has 50 GB": (sized("created.json", 50 * 10**9), "is no file of a run"),
    "a marker has 50 GB": (sized("blocks/000000000.json", 50 * 10**9), "is no file of a run"),
    "a chunk has 50 TB": (sized("status/c.0", 10**13), "is torn"),
    "times have 50 TB": (sized("time/c.0", 10**13), "is torn"),
    "a shape of 10^15": (array("status", shape=[10**15]), "has the shape"),
    "times of 10^11": (
        array("time", shape=[10**11], chunk_grid={"name": "regular", "configuration": {"chunk_shape": [10**11]}}),
        "has chunks of",
    ),
    "a negative shape": (array("status", shape=[-300]), "has the shape"),
    "a shape of truth values": (array("status", shape=[True]), "has the shape"),
    "another shape": (array("status", shape=[301]), "status has the type"),
    "an array of objects": (array("status", data_type="object"), "has the type"),
    "an array of texts": (array("status", data_type="string"), "has the type"),
    "an array of another type": (array("status", data_type="float64"), "of status is"),
    "big endian": (
        array("failure_time", codecs=[{"name": "bytes", "configuration": {"endian": "big"}}, {"name": "crc32c"}]),
        "codecs of failure_time",
    ),
    **{f"codec {name}": (array("status", codecs=codecs), "codecs of status") for name, codecs in CODECS},
    "a transformer": (array("status", storage_transformers=[{"name": "evil_module"}]), "storage_transformers of status"),
    "a key nobody knows": (array("status", evil_module=1), "evil_module of status"),
    "slashes in keys": (
        array("status", chunk_key_encoding={"name": "default", "configuration": {"separator": "/"}}),
        "chunk_key_encoding of status",
    ),
    "an array above": (array("../status"), "is no name of an array"),
    "an array with a drive": (array("C:status"), "is no name of an array"),
    "an array nobody knows": (array("evil"), "evil has the type"),
    "a group nobody knows": (array("evil/status"), "groups that no run has"),
    "no status": (lacks("status"), "has no status"),
    "no times": (lacks("time"), "has no time"),
    "attributes with tables": (array("status", attributes={"a": {"b": {}}}), "attributes of status"),
    # Texts that fit their checksums.
    "no members": (text("recipe", "members", value=0), "recipe.members is 0"),
    "10^18 members": (text("recipe", "members", value=10**18), "recipe.members is 1000000000000000000"),
    "members as text": (text("recipe", "members", value="300"), "recipe.members is '300'"),
    "members that are true": (text("recipe", "members", value=True), "recipe.members is True"),
    "other members": (text("recipe", "members", value=2**31), "has the type"),
    "more members than there are": (text("members", value=400), "members are 400 of 300"),
    "a packet of 10^9": (text("recipe", "width", value=10**9), "recipe.width is 1000000000"),
    "fields nobody knows": (text("recipe", "fields", value=["../x"]), "recipe.fields"),
    "a step that is a text": (text("provenance", "step", value="os.system"), "provenance.step"),
    "a step of NaN": (text("provenance", "step", value=float("nan")), "provenance.step"),
    "versions that write on the terminal": (
        text("provenance", "versions", value={"lgvi-warp": "\x1b]0;x\x07"}),
        "provenance.versions",
    ),
    "messages that write on the terminal": (text("messages", value=["\x1b[2J"]), "no list of texts"),
    "messages that are none": (text("messages", value=7), "no list of texts"),
    "complete, says a text": (text("complete", value="yes"), "complete is no truth value"),
    "an attribute nobody knows": (text("evil_module", value="x"), "is not known"),
    "a chunk of no bytes": (text("recipe", "store", "chunk_bytes", value=0), "recipe.store"),
    "statistics of functions": (text("provenance", "observed", "functions", value=["evil_module.run"]), None),
    "a statistic nobody knows": (text("provenance", "observed", "statistics", value=[{"type": "evil_module"}]), None),
    "a statistic of a module": (
        text("provenance", "observed", "statistics", value=[{"type": "mean", "of": "evil_module.run"}]),
        None,
    ),
    "statistics that are others": (
        text("provenance", "observed", "statistics", value=[{"type": "mean", "of": "speed"}]),
        None,
    ),
    "kept members that there are not": (text("provenance", "observed", "keep", value=[3, 10**6]), None),
    "a term of a module": (text("provenance", "scene", "terms", value=[{"type": "evil_module.run"}]), None),
    "a distribution of a module": (
        text("provenance", "ensemble", "vary", value={"vehicle.mass": {"scipy": {"name": "evil_module"}}}),
        None,
    ),
    "a method of a module": (text("recipe", "method", "name", value="__import__('evil_module')"), None),
    "a method with other keys": (text("recipe", "method", value={"evil_module": 1}), None),
    "a table of zeros without an end": (text("provenance", "ensemble", "sampling", value=CSV), None),
    "a table without its checksum": (
        text("provenance", "ensemble", "sampling", value=lambda home: {"table": {"file": str(home / "secret")}}),
        None,
    ),
    "a scene that is none": (text("provenance", "scene", value={"vehicle": 3}), None),
    "parameters that are texts": (text("shared", value={"vehicle.mass": ["evil_module"]}), None),
    # What blocks hold.
    "parts with a pickle": (parts(pickled), None),
    "parts of 10^15 numbers": (parts(npy(HUGE)), None),
    "parts of 10^15 times nothing": (parts(npy(EMPTY_TYPE)), None),
    "parts whose header is a call": (parts(npy(CALL)), None),
    "parts that are empty": (parts(b""), None),
    "parts with other arrays": (parts(npy(WORD, "[]".encode("utf-32-le"))), None),
    "a status nobody knows": (chunk("status", np.full(256, 200, np.uint8)), None),
    "a torn chunk": (lambda path, home: os.truncate(path / "status" / "c.0", 100), "is torn"),
    "a lost chunk": (lambda path, home: (path / "status" / "c.0").unlink(), "is missing"),
    "kept says other members": (
        lambda path, home: text("recipe", "members", value=3)(path / "kept", home),
        "is damaged",
    ),
}  # fmt: skip


def zipped(arrays, compression=zipfile.ZIP_STORED):
    """An .npz with these files."""

    def make(path, home):
        with zipfile.ZipFile(path, "w", compression) as archive:
            for name, data in arrays.items():
                archive.writestr(name, data(home) if callable(data) else data)

    return make


def changed(**arrays):
    """A result with other arrays; None leaves one out."""

    def make(path, home):
        with np.load(path) as data:
            own = {name: data[name] for name in data.files}
        for name, value in arrays.items():
            own[name] = value(own[name]) if callable(value) else value
        np.savez(path, **{name: value for name, value in own.items() if value is not None})

    return make


def told(**changes):
    """A result whose provenance says something else."""

    def make(path, home):
        changed(provenance=lambda old: np.array(json.dumps(json.loads(str(old)) | changes)))(path, home)

    return make


def torn(part):
    return lambda path, home: os.truncate(path, int(part * path.stat().st_size))


def overlapping(path, home):
    """A thousand files, all of them the same bytes."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("time.npy", bytes(10**6))
        one = archive.filelist[0]
        for i in range(1000):
            again = zipfile.ZipInfo(f"{i}.npy")
            for name in ("header_offset", "file_size", "compress_size", "CRC"):
                setattr(again, name, getattr(one, name))
            archive.filelist.append(again)
            archive.NameToInfo[again.filename] = again


def long_list(path, home):
    """The list of files alone has 60 MB."""
    entry = struct.pack("<4s4B4HL2L5H2L", b"PK\1\2", 20, 3, 20, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0) + b"a"
    count = 60_000_000 // len(entry)
    path.write_bytes(entry * count + struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 9, 9, len(entry) * count, 0, 0))


def special_file(make):
    def harm(path, home):
        path.unlink()
        make(path)

    return harm


# Each result: how it is made, and what Result.load says of it.
RESULTS = {
    **{f"torn at {part}": (torn(part), "is torn or no .npz file") for part in (0.0, 0.001, 0.3, 0.7, 0.999)},
    "no .npz": (content("", b"time,depth\n0,1\n"), "is torn or no .npz file"),
    "changed within": (lambda path, home: _flip(path), "is torn"),
    "a pipe": (special_file(os.mkfifo), "pipe"),
    "zeros without an end": (special_file(lambda path: path.symlink_to("/dev/zero")), "device"),
    "a compressed bomb": (zipped({"time.npy": bytes(4 * 10**8)}, zipfile.ZIP_DEFLATED), "is compressed"),
    "the same bytes a thousand times": (overlapping, "promises more bytes"),
    "a list of files without an end": (long_list, "list of files is too long"),
    "a pickle": (zipped({"time.npy": pickled}), "promises an array of type object"),
    "a pickle that is no array": (
        zipped({"time": lambda home: pickle.dumps(Payload(home / "pickled"))}),
        "magic string",
    ),
    "10^15 numbers": (zipped({"time.npy": npy(HUGE)}), "promises an array"),
    "10^15 times nothing": (zipped({"time.npy": npy(EMPTY_TYPE)}), "promises an array"),
    "a header that is a call": (zipped({"time.npy": npy(CALL)}), "header"),
    "a name that leads out": (zipped({"../../home/notes.txt": npy(HUGE)}), "promises an array"),
    "no times": (changed(time=None), "has no time"),
    "no status": (changed(status=None), "has no status"),
    "other members": (changed(status=lambda old: old[:-1]), "has the type"),
    "other times": (changed(time=lambda old: old[:-1]), "has the type"),
    "a status of reals": (changed(status=lambda old: old.astype(float)), "'status' has the type float64"),
    "texts for positions": (changed(position=lambda old: old.astype(str)), "'position' has the type"),
    "an array nobody knows": (changed(evil_module=np.zeros(3)), "'evil_module' has the type"),
    "messages that are none": (changed(messages=np.array("{}")), "messages"),
    "provenance without an end": (changed(provenance=np.array("[" * 200_000)), "nested too deep"),
    "provenance that is none": (changed(provenance=np.array("[]")), "provenance tells no"),
    "a term of a module": (told(scene={"terms": [{"type": "evil_module.run"}]}), "terms[0].type"),
    "a scene that is none": (told(scene={"terms": 7}), "terms = 7"),
    "statistics without a text": (changed(statistics=np.array("{}")), None),
    "statistics of a module": (changed(statistics=np.array('[{"name": "evil_module"}]')), "is damaged"),
    "kept members that there are not": (changed(**{"kept/members": np.array([10**9])}), "kept/members"),
}


def _flip(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


# Folders of studies, sweeps and results: base, how it is harmed, and what `lgvi-warp info` says of it, None where it says
# nothing against it.

OUT = "leads out of its folder"
STUDIES = ("tradeoff", "sensitivity", "stability", "sweep")


def nested(depth):
    return b'{"a": ' + b"[" * depth + b"]" * depth + b"}"


def named(name):
    """One more file, of a name that a file system allows."""
    return lambda path, home: (path / name).write_text("x")


def told_otherwise(name, /, **changes):
    """The content of a JSON file has other values."""

    def harm(path, home):
        content = json.loads((path / name).read_text())
        (path / name).write_text(json.dumps(content | changes))

    return harm


def beside_itself(name):
    """A link to a file of the same folder."""

    def harm(path, home):
        (path / name).rename(path / "real")
        (path / name).symlink_to("real")

    return harm


def loop(name):
    def harm(path, home):
        (path / name).unlink()
        (path / name).symlink_to(name)

    return harm


def numbers_of(study):
    """What is wrong with the file of a study's numbers."""
    file = f"{study}.json"
    return {
        "a link to a secret": (link(file, "secret"), OUT),
        "a link to zeros": (link(file, "/dev/zero"), OUT),
        "a link that leads nowhere": (link(file, "nothing"), "lgvi-warp:"),
        "a link to itself": (loop(file), "lgvi-warp:"),
        "a link beside it": (beside_itself(file), None),
        "a pipe": (special(file, os.mkfifo), "is a named pipe"),
        "a socket": (special(file, bound), "is a socket"),
        "a folder": (special(file, os.mkdir), "is a folder"),
        "50 GB": (sized(file, 50 * 10**9), "more than the 64.0 MB"),
        "nested 200,000 deep": (content(file, nested(200_000)), "is nested too deep"),
        "nested 900 deep": (content(file, nested(900)), "is nested too deep"),
        "a list": (content(file, b"[]"), None if study == "sweep" else "is damaged"),
        "a number": (content(file, b"3"), None if study == "sweep" else "is damaged"),
        "a number of 5,000 digits": (content(file, b"9" * 5000), "is damaged"),
        "no JSON": (content(file, b"time,depth\n"), "is damaged"),
        "not UTF-8": (content(file, bytes(range(256))), "is no text in UTF-8"),
        "empty": (content(file, b""), "is damaged"),
        "half": (lambda path, home: os.truncate(path / file, (path / file).stat().st_size // 2), "is damaged"),
    }


FOLDERS = {
    f"{study}: {what}": (study, *made) for study in STUDIES for what, made in numbers_of(study).items()
} | {
    "tradeoff: other names": ("tradeoff", told_otherwise("tradeoff.json", of=["\x1b[2J"]), None),
    "tradeoff: messages are a number": ("tradeoff", told_otherwise("tradeoff.json", messages=7), "is damaged"),
    "tradeoff: units write on the terminal": ("tradeoff", told_otherwise("tradeoff.json", messages=["\x1b]0;x\x07"]), None),
    "tradeoff: the table is a link": ("tradeoff", link("tradeoff.csv", "secret"), None),
    "tradeoff: the table is a pipe": ("tradeoff", special("tradeoff.csv", os.mkfifo), None),
    "tradeoff: the table has a long field": ("tradeoff", content("tradeoff.csv", b"a" * 200_000), None),
    "tradeoff: the table is no text": ("tradeoff", content("tradeoff.csv", bytes(range(256))), None),
    "tradeoff: the table has zero bytes": ("tradeoff", content("tradeoff.csv", b"a,b\n\0,\0\n"), None),
    "tradeoff: the table has 50 GB": ("tradeoff", sized("tradeoff.csv", 50 * 10**9), None),
    "tradeoff: a picture is a link": ("tradeoff", link("x.png", "secret"), None),
    "tradeoff: a picture is a link to zeros": ("tradeoff", link("x.png", "/dev/zero"), None),
    "tradeoff: a picture is a pipe": ("tradeoff", special("x.png", os.mkfifo), None),
    "tradeoff: a picture has 200 names": ("tradeoff", often("x.png", 10**7, 200), None),
    "tradeoff: a picture has 50 GB": ("tradeoff", sized("x.png", 50 * 10**9), None),
    "tradeoff: a name writes on the terminal": ("tradeoff", named("\x1b]0;x\x07\x1b[2J.png"), None),
    "tradeoff: a name of two lines": ("tradeoff", named("a\nb.csv"), None),
    "sensitivity: 10^5 names each": (
        "sensitivity",
        told_otherwise("sensitivity.json", quantities=["q"] * 10**5, factors=["f"] * 10**5),
        "rows for 100,000 quantities",
    ),
    "sensitivity: another analysis": ("sensitivity", told_otherwise("sensitivity.json", name="evil_module"), "is no analysis"),
    "stability: texts for numbers": ("stability", told_otherwise("stability.json", classes={"psi": [["x"]]}), "is damaged"),
    "stability: a class nobody knows": ("stability", told_otherwise("stability.json", classes={"psi": [[9**9, 3]]}), None),
    "stability: no methods": ("stability", told_otherwise("stability.json", classes={}), None),
    "sweep: the summary writes on the terminal": ("sweep", content("summary.md", b"\x1b]0;x\x07\x1b[2J\xc2\x9b2J"), None),
    "sweep: the summary is a link": ("sweep", link("summary.md", "secret"), OUT),
    "sweep: the summary is a pipe": ("sweep", special("summary.md", os.mkfifo), "is a named pipe"),
    "sweep: the summary has 50 GB": ("sweep", sized("summary.md", 50 * 10**9), "more than the 16.8 MB"),
    "sweep: no summary": ("sweep", lambda path, home: (path / "summary.md").unlink(), "No such file"),
    "result: a link to a secret": ("result", link("result.npz", "secret"), OUT),
    "result: a link to zeros": ("result", link("result.npz", "/dev/zero"), OUT),
    "result: a pipe": ("result", special("result.npz", os.mkfifo), "is a named pipe"),
    "result: a folder": ("result", special("result.npz", os.mkdir), "is a folder"),
    "result: a part is a link": ("result", link("result_part.npz", "secret"), OUT),
    "result: a store is a link": ("result", link("run.zarr", "work"), "is a link"),
    "result: a store is a pipe": ("result", special("run.zarr", os.mkfifo), "run.zarr"),
    "result: a term of a module": (
        "result",
        lambda path, home: told(scene={"terms": [{"type": "evil_module.run"}]})(path / "result.npz", home),
        "terms[0].type",
    ),
    "result: a step that is a text": (
        "result",
        lambda path, home: told(versions=7, ensemble=[], machine="\x1b[2J")(path / "result.npz", home),
        None,
    ),
}  # fmt: skip

# What lies in the place of a file that a verb writes: how it gets there, and whether the file is written.
PLACES = {
    "a link to the user's file": (link, "notes.txt", False),
    "a link to nothing of the user's": (link, "new.txt", False),
    "a link to a device": (link, "/dev/null", False),
    "a link to a pipe": (link, "pipe", False),
    "a pipe": (special, os.mkfifo, False),
    "a socket": (special, bound, False),
    "a folder": (special, os.mkdir, False),
}


def cell(**changes):
    """A cell with other arrays; None leaves one out."""
    return lambda path, home: changed(**changes)(path, home)


def words(**changes):
    def harm(path, home):
        def other(old):
            return np.frombuffer(json.dumps(json.loads(old.tobytes()) | changes).encode(), np.uint8)

        changed(words=other)(path, home)

    return harm


# Each file of a cell of a sweep: how it is damaged. All of them are run anew, with the same bytes.
CELLS = {
    **{f"torn at {part}": torn(part) for part in (0.0, 0.001, 0.5, 0.999)},
    "no .npz": content("", b"time,depth\n"),
    "changed within": lambda path, home: _flip(path),
    "a compressed bomb": zipped({"words.npy": bytes(4 * 10**8)}, zipfile.ZIP_DEFLATED),
    "a pickle": zipped({"words.npy": pickled}),
    "73 TiB": zipped({"words.npy": npy(HUGE), "status.npy": npy(HUGE), "numbers.npy": npy(HUGE)}),
    "words of 10^15 times nothing": zipped({"words.npy": npy(EMPTY_TYPE)}),
    "fewer members": cell(status=lambda old: old[:-1], numbers=lambda old: old[:, :-1]),
    "no members": cell(status=lambda old: old[:0], numbers=lambda old: old[:, :0]),
    "a status of texts": cell(status=lambda old: old.astype(str)),
    "a status nobody knows": cell(status=lambda old: np.full_like(old, 250)),
    "another status": cell(status=lambda old: old + np.uint8(1)),
    "numbers of three dimensions": cell(numbers=lambda old: old[None]),
    "numbers of another length": cell(numbers=lambda old: old[:, :3]),
    "numbers of NaN": cell(numbers=lambda old: np.full_like(old, np.nan)),
    "one number is another": cell(numbers=lambda old: old + (np.arange(old.size) == 0).reshape(old.shape)),
    "other metrics": words(metrics=["evil_module"]),
    "metrics that are none": words(metrics=7),
    "other messages": words(messages=["\x1b[2J all is well"]),
    "messages that are none": words(messages={"a": 1}),
    "another checksum": words(crc32=0),
    "no checksum": words(crc32=None),
    "words nested 200,000 deep": cell(words=np.frombuffer(b"[" * 200_000, np.uint8)),
    "no words": cell(words=None),
}
