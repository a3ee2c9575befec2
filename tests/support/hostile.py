# SPDX-License-Identifier: Apache-2.0
"""Folders and files that somebody made to do harm, or that were damaged: a table.

A harm is a function of a path and of the user's folder: it damages what lies at the path, made by a program before.
"""

import json
import os
import pickle
import socket
import struct
import zipfile

import numpy as np

from lgvi_warp.store import folder as store
from lgvi_warp.store.block_files import marker, read_marker

ROOT, STATUS, PARTS, MARKER = "zarr.json", "status/c.0", "parts/000000000.npy", "blocks/000000000.json"
TEXTS = ("provenance", "recipe", "messages", "shared")
checksum = store.durable.checksum

# What may lie in the place of any file ----------------------------------------------------------------------------------


def at(name, harm):
    """A harm to what lies below the path."""
    return lambda path, home: harm(path / name, home)


def link(to):
    """A link in the place of a file or folder, which goes aside; to: below the user's folder, or a whole path."""

    def harm(path, home):
        if os.path.lexists(path):
            path.rename(home.parent / "moved")
        path.symlink_to(home / to)

    return harm


def special(make):
    """Special file in the place of a file."""

    def harm(path, home):
        path.unlink(missing_ok=True)
        make(path)

    return harm


def bind(path):
    """A socket; its path must be short."""
    here = os.getcwd()
    os.chdir(path.parent)
    try:
        socket.socket(socket.AF_UNIX).bind(path.name)
    finally:
        os.chdir(here)


pipe, bound, folder = special(os.mkfifo), special(bind), special(os.mkdir)
to_itself = special(lambda path: path.symlink_to(path.name))


def content(data):
    """Other bytes; data: what they are, perhaps of the user's folder."""
    return lambda path, home: path.write_bytes(data(home) if callable(data) else data)


def sized(size):
    """So many zeros, which take no room."""
    return lambda path, home: path.write_bytes(b"") or os.truncate(path, size)


def torn(share):
    return lambda path, home: os.truncate(path, int(share * path.stat().st_size))


def removed(path, home):
    path.unlink()


def flipped(path, home):
    """One bit in the middle is another."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def moved_beside(path, home):
    """A link to the file, which has another name in the same folder."""
    path.rename(path.with_name("real"))
    path.symlink_to("real")


def often(size, count):
    """So many zeros, and links to them beside the file."""

    def harm(path, home):
        sized(size)(path, home)
        for i in range(count):
            path.with_name(f"{i}{path.name}").symlink_to(path.name)

    return harm


def other_keys(**changes):
    """A JSON file tells other values."""
    return lambda path, home: path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def nested(depth):
    return content(b'{"a": ' + b"[" * depth + b"]" * depth + b"}")


# What lies in the place of a file that a verb writes; none of it is replaced.
PLACES = {
    "a link to the user's file": link("notes.txt"), "a link to nothing of the user's": link("new.txt"),
    "a link to a device": link("/dev/null"), "a link to a pipe": link("pipe"), "a pipe": pipe, "a socket": bound,
    "a folder": folder,
}  # fmt: skip

# Arrays in NumPy's format -----------------------------------------------------------------------------------------------


class Payload:
    """Pickled, it writes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def npy(described, data=b""):
    """An array with any header."""
    header = described.encode().ljust(118 - 1) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + data


def of_type(descr, shape):
    return f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}"


HUGE = npy(of_type("'<f8'", (10**15,)))
HUGE_OF_NOTHING = npy(of_type("'|V0'", (10**15,)))
CALL = npy(of_type("__import__('os').mkdir('called')", ()))
WORD = npy(of_type("'<U2'", ()), "[]".encode("utf-32-le"))


def payload(home):
    return pickle.dumps(Payload(home / "pickled"))


def pickled(home):
    return npy(of_type("'|O'", ()), payload(home))


def zipped(compression=zipfile.ZIP_STORED, **arrays):
    """An .npz with these files."""

    def harm(path, home):
        with zipfile.ZipFile(path, "w", compression) as archive:
            for name, data in arrays.items():
                archive.writestr(name, data(home) if callable(data) else data)

    return harm


def bomb(name):
    return zipped(zipfile.ZIP_DEFLATED, **{name: bytes(4 * 10**8)})


def arrays(**changes):
    """An .npz with other arrays, some of them functions of the old ones; None leaves one out."""

    def harm(path, home):
        with np.load(path) as data:
            own = {name: data[name] for name in data.files}
        for name, value in changes.items():
            own[name] = value(own[name]) if callable(value) else value
        np.savez(path, **{name: value for name, value in own.items() if value is not None})

    return harm


def told(**changes):
    """A result whose provenance says something else."""
    return arrays(provenance=lambda old: np.array(json.dumps(json.loads(str(old)) | changes)))


def words(**changes):
    """A cell of a sweep whose words say something else."""
    return arrays(words=lambda old: np.frombuffer(json.dumps(json.loads(old.tobytes()) | changes).encode(), np.uint8))


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


# Stores -----------------------------------------------------------------------------------------------------------------


def said(path):
    """Content of a store's root, with its texts read."""
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


def text(key, value):
    """One of the texts of a store has another value, and the checksums fit: consistent, but wrong."""

    def harm(path, home):
        content = said(path)
        *keys, last = key.split(".")
        table = content["attributes"]
        for one in keys:
            table = table[one]
        table[last] = value(home) if callable(value) else value
        say(path, content)

    return harm


def array(name, **changes):
    """The metadata of an array is another one."""

    def harm(path, home):
        content = said(path)
        metadata = content["consolidated_metadata"]["metadata"]
        metadata[name] = metadata.get(name, dict(metadata["status"])) | changes
        say(path, content)

    return harm


def lacks(name):
    def harm(path, home):
        content = said(path)
        del content["consolidated_metadata"]["metadata"][name]
        say(path, content)

    return harm


def regular(*shape):
    return {"name": "regular", "configuration": {"chunk_shape": shape}}


def codec(name, **configuration):
    return {"name": name, "configuration": configuration}


def mark(path, name, entry, file=MARKER):
    """A marker has another entry, and its own checksum fits."""
    sums = read_marker(path, file)
    sums[name] = entry
    (path / file).write_bytes(marker(sums))


def marks(key, size=6, crc=0, file=MARKER):
    """A marker, or the list of the frame's files, names another file too; crc: None for that of the file."""

    def harm(path, home):
        name = key.format(home=home)
        entry = [size, crc]
        if crc is None and (path / name).is_file():
            data = (path / name).read_bytes()
            entry = [len(data), checksum(data)]
        mark(path, name, entry, file)

    return harm


def lists(key, size=6, crc=0):
    return marks(key, size, crc, "created.json")


def block(name, data):
    """Other bytes in a file of the first block, whose checksum fits."""

    def harm(path, home):
        found = data(home) if callable(data) else data
        (path / name).write_bytes(found)
        mark(path, name, [len(found), checksum(found)])

    return harm


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


UNKNOWN, MARK, NAMES = "is not a file of it", "does not fit the arrays", "created.json is damaged"
DAMAGED, LINKED, GB50, EVIL = "is damaged", "is a link", sized(50 * 10**9), [{"type": "evil_module.run"}]
OBSERVED, SAMPLING = "provenance.observed", "provenance.ensemble.sampling"
BIG_ENDIAN = [codec("bytes", endian="big"), {"name": "crc32c"}]
BLOSC = [codec("bytes", endian="little"), codec("blosc")]
STRANGERS = np.full(256, 200, np.uint8).tobytes()

# Each store: how it is made, and what `lgvi-warp info` says of it, None where it says nothing against it.
STORES = {
    # Names that lead out of the folder, or that are no names.
    "created names a file above": (lists("../../home/notes.txt", crc=None), MARK),
    "created names an absolute path": (lists("{home}/notes.txt", crc=None), MARK),
    "created names a path that goes in and out": (lists("time/../../../home/notes.txt", crc=None), MARK),
    "created names a NUL": (lists("time/c\0.0"), MARK),
    "created names backslashes": (lists("..\\..\\home\\notes.txt"), MARK),
    "created names a drive": (lists("C:/notes.txt"), MARK),
    "created names 3000 letters": (lists("a" * 3000), MARK),
    "created names itself": (lists("created.json"), MARK),
    "created names nothing": (lists(""), MARK),
    "created names a huge size": (lists("time/c.0", 10**18), MARK),
    "created has a negative size": (lists("time/c.0", -1), NAMES),
    "created has texts for sizes": (lists("time/c.0", "12"), NAMES),
    "marker names a file above": (marks("../../home/notes.txt", crc=None), UNKNOWN),
    "marker names an absolute path": (marks("{home}/notes.txt", crc=None), UNKNOWN),
    "marker names the settings of a user": (marks("{home}/.ssh/config", crc=None), UNKNOWN),
    "marker names a path that goes in and out": (marks("status/../../../home/notes.txt", crc=None), UNKNOWN),
    "marker names a NUL": (marks("status/c\0.0"), UNKNOWN),
    "marker names backslashes": (marks("status\\c.0"), UNKNOWN),
    "marker names a drive": (marks("C:c.0"), UNKNOWN),
    "marker names another block's chunk": (marks("status/c.1", crc=None), UNKNOWN),
    "marker names another block's parts": (marks("parts/000000256.npy"), UNKNOWN),
    "marker names the root": (marks(ROOT, crc=None), UNKNOWN),
    "marker names the terminal": (marks("\x1b[2Jstatus"), UNKNOWN),
    "marker has a huge size": (marks(STATUS, 10**15), "bytes in the marker, not"),
    "marker is a list": (at(MARKER, content(b"[]\n00000000\n")), "not complete"),
    # Links and what is no file.
    "a chunk is a link": (at(STATUS, link("secret")), LINKED),
    "a chunk is a link to zeros": (at(STATUS, link("/dev/zero")), LINKED),
    "a chunk is a link into the store": (at(STATUS, link("../store/run.zarr/status/c.1")), LINKED),
    "an array is a link": (at("status", link("work")), LINKED),
    "the markers are a link": (at("blocks", link("work")), LINKED),
    "the parts are a link": (at("parts", link("work")), LINKED),
    "a marker is a link": (at(MARKER, link("secret")), LINKED),
    "the root is a link": (at(ROOT, link("secret")), LINKED),
    "created is a link": (at("created.json", link("secret")), LINKED),
    "kept is a link": (at("kept", link("work")), DAMAGED),
    "kept's root is a link": (at("kept/zarr.json", link("secret")), DAMAGED),
    "a link leads nowhere": (at(STATUS, link("nothing")), LINKED),
    "the store is a link": (lambda path, home: path.symlink_to(path.rename(home / "run.zarr")), "is a link. Name the store"),
    "a chunk is a pipe": (at(STATUS, pipe), "pipe"),
    "the root is a pipe": (at(ROOT, pipe), "pipe"),
    "created is a pipe": (at("created.json", pipe), "pipe"),
    "a marker is a pipe": (at(MARKER, pipe), "pipe"),
    "a chunk is a socket": (at(STATUS, bound), "socket"),
    "a chunk is a folder": (at(STATUS, folder), "is a folder"),
    "the root is a folder": (at(ROOT, folder), "is a folder"),
    "folders without an end": (endless, "lies deeper"),
    # The root's metadata.
    "the root is empty": (at(ROOT, content(b"")), DAMAGED),
    "the root is not a text": (at(ROOT, content(bytes(range(256)))), DAMAGED),
    "the root is a list": (at(ROOT, content(b"[]")), DAMAGED),
    "the root is half": (lambda path, home: os.truncate(path / ROOT, 3000), DAMAGED),
    "the root is nested without an end": (at(ROOT, content(b"[" * 200_000)), DAMAGED),
    "the root has a number of 5000 digits": (at(ROOT, content(b'{"attributes":' + b"9" * 5000 + b"}")), DAMAGED),
    "the root has 50 GB": (at(ROOT, GB50), "is not a file of a run"),
    "created has 50 GB": (at("created.json", GB50), "is not a file of a run"),
    "a marker has 50 GB": (at(MARKER, GB50), "is not a file of a run"),
    "a chunk has 50 TB": (at(STATUS, sized(10**13)), "is torn"),
    "times have 50 TB": (at("time/c.0", sized(10**13)), "is torn"),
    "a shape of 10^15": (array("status", shape=[10**15]), "has the shape"),
    "times of 10^11": (array("time", shape=[10**11], chunk_grid=regular(10**11)), "has chunks of"),
    "a negative shape": (array("status", shape=[-300]), "has the shape"),
    "a shape of truth values": (array("status", shape=[True]), "has the shape"),
    "another shape": (array("status", shape=[301]), "status has the type"),
    "an array of objects": (array("status", data_type="object"), "has the type"),
    "an array of texts": (array("status", data_type="string"), "has the type"),
    "an array of another type": (array("status", data_type="float64"), "of status is"),
    "big endian": (array("failure_time", codecs=BIG_ENDIAN), "codecs of failure_time"),
    "codec blosc": (array("status", codecs=BLOSC), "codecs of status"),
    "codec pickle": (array("status", codecs=[codec("numcodecs.pickle", protocol=5)]), "codecs of status"),
    "codec sharding": (array("status", codecs=[codec("sharding_indexed", chunk_shape=[1])]), "codecs of status"),
    "codec none": (array("status", codecs=[]), "codecs of status"),
    "a transformer": (array("status", storage_transformers=[{"name": "evil_module"}]), "storage_transformers of status"),
    "a key nobody knows": (array("status", evil_module=1), "evil_module of status"),
    "slashes in keys": (array("status", chunk_key_encoding=codec("default", separator="/")), "chunk_key_encoding of status"),
    "an array above": (array("../status"), "is not a name of an array"),
    "an array with a drive": (array("C:status"), "is not a name of an array"),
    "an array nobody knows": (array("evil"), "evil has the type"),
    "a group nobody knows": (array("evil/status"), "groups that no run has"),
    "no status": (lacks("status"), "has no status"),
    "no times": (lacks("time"), "has no time"),
    "attributes with tables": (array("status", attributes={"a": {"b": {}}}), "attributes of status"),
    # Texts that fit their checksums.
    "no members": (text("recipe.members", 0), "recipe.members is 0"),
    "10^18 members": (text("recipe.members", 10**18), "recipe.members is 1000000000000000000"),
    "members as text": (text("recipe.members", "300"), "recipe.members is '300'"),
    "members that are true": (text("recipe.members", True), "recipe.members is True"),
    "other members": (text("recipe.members", 2**31), "has the type"),
    "more members than there are": (text("members", 400), "members are 400 of 300"),
    "a packet of 10^9": (text("recipe.width", 10**9), "recipe.width is 1000000000"),
    "fields nobody knows": (text("recipe.fields", ["../x"]), "recipe.fields"),
    "a step that is a text": (text("provenance.step", "os.system"), "provenance.step"),
    "a step of NaN": (text("provenance.step", float("nan")), "provenance.step"),
    "versions that write on the terminal": (text("provenance.versions", {"lgvi-warp": "\x1b]0;x\x07"}), "provenance.versions"),
    "messages that write on the terminal": (text("messages", ["\x1b[2J"]), "no list of texts"),
    "messages that are none": (text("messages", 7), "no list of texts"),
    "complete, says a text": (text("complete", "yes"), "complete is not a truth value"),
    "an attribute nobody knows": (text("evil_module", "x"), "is not known"),
    "a chunk of no bytes": (text("recipe.store.chunk_bytes", 0), "recipe.store"),
    "statistics of functions": (text(f"{OBSERVED}.functions", ["evil_module.run"]), None),
    "a statistic nobody knows": (text(f"{OBSERVED}.statistics", [{"type": "evil_module"}]), None),
    "a statistic of a module": (text(f"{OBSERVED}.statistics", [{"type": "mean", "of": "evil_module.run"}]), None),
    "statistics that are others": (text(f"{OBSERVED}.statistics", [{"type": "mean", "of": "speed"}]), None),
    "kept members that there are not": (text(f"{OBSERVED}.keep", [3, 10**6]), None),
    "a term of a module": (text("provenance.scene.terms", EVIL), None),
    "a distribution of a module": (
        text("provenance.ensemble.vary", {"vehicle.mass": {"scipy": {"name": "evil_module"}}}), None),
    "a method of a module": (text("recipe.method.name", "__import__('evil_module')"), None),
    "a method with other keys": (text("recipe.method", {"evil_module": 1}), None),
    "a table of zeros without an end": (text(SAMPLING, {"table": {"file": "/dev/zero", "sha256": "0" * 64}}), None),
    "a table without its checksum": (text(SAMPLING, lambda home: {"table": {"file": str(home / "secret")}}), None),
    "a scene that is none": (text("provenance.scene", {"vehicle": 3}), None),
    "parameters that are texts": (text("shared", {"vehicle.mass": ["evil_module"]}), None),
    # What blocks hold.
    "parts with a pickle": (block(PARTS, pickled), None),
    "parts of 10^15 numbers": (block(PARTS, HUGE), None),
    "parts of 10^15 times nothing": (block(PARTS, HUGE_OF_NOTHING), None),
    "parts whose header is a call": (block(PARTS, CALL), None),
    "parts that are empty": (block(PARTS, b""), None),
    "parts with other arrays": (block(PARTS, WORD), None),
    "a status nobody knows": (block(STATUS, STRANGERS + checksum(STRANGERS).to_bytes(4, "little")), None),
    "a torn chunk": (lambda path, home: os.truncate(path / STATUS, 100), "is torn"),
    "a lost chunk": (at(STATUS, removed), "is missing"),
    "kept says other members": (at("kept", text("recipe.members", 3)), DAMAGED),
}  # fmt: skip

# Each result.npz: how it is made, and what `lgvi-warp info` and Result.load say of it.
TORN, OUT = "is torn or no .npz file", "leads out of its folder"
RESULTS = {
    **{f"torn at {share}": (torn(share), TORN) for share in (0.0, 0.001, 0.3, 0.7, 0.999)},
    "no .npz": (content(b"time,depth\n0,1\n"), TORN),
    "changed within": (flipped, "is torn"),
    "a link to a secret": (link("secret"), OUT),
    "a link to zeros": (link("/dev/zero"), OUT),
    "a pipe": (pipe, "is a named pipe"),
    "a folder": (folder, "is a folder"),
    "a compressed bomb": (bomb("time.npy"), "is compressed"),
    "the same bytes a thousand times": (overlapping, "promises more bytes"),
    "a list of files without an end": (long_list, "list of files is too long"),
    "a pickle": (zipped(**{"time.npy": pickled}), "promises an array of type object"),
    "a pickle that is not an array": (zipped(time=payload), "magic string"),
    "10^15 numbers": (zipped(**{"time.npy": HUGE}), "promises an array"),
    "10^15 times nothing": (zipped(**{"time.npy": HUGE_OF_NOTHING}), "promises an array"),
    "a header that is a call": (zipped(**{"time.npy": CALL}), "header"),
    "a name that leads out": (zipped(**{"../../home/notes.txt": HUGE}), "promises an array"),
    "no times": (arrays(time=None), "has no time"),
    "no status": (arrays(status=None), "has no status"),
    "other members": (arrays(status=lambda old: old[:-1]), "has the type"),
    "other times": (arrays(time=lambda old: old[:-1]), "has the type"),
    "a status of reals": (arrays(status=lambda old: old.astype(float)), "'status' has the type float64"),
    "texts for positions": (arrays(position=lambda old: old.astype(str)), "'position' has the type"),
    "an array nobody knows": (arrays(evil_module=np.zeros(3)), "'evil_module' has the type"),
    "messages that are none": (arrays(messages=np.array("{}")), "messages"),
    "provenance without an end": (arrays(provenance=np.array("[" * 200_000)), "nested too deep"),
    "provenance that is none": (arrays(provenance=np.array("[]")), "provenance tells no"),
    "a term of a module": (told(scene={"terms": EVIL}), "terms[0].type"),
    "a scene that is none": (told(scene={"terms": 7}), "terms = 7"),
    "a step that is a text": (told(versions=7, ensemble=[], machine="\x1b[2J"), None),
    "statistics without a text": (arrays(statistics=np.array("{}")), None),
    "statistics of a module": (arrays(statistics=np.array('[{"name": "evil_module"}]')), DAMAGED),
    "kept members that there are not": (arrays(**{"kept/members": np.array([10**9])}), "kept/members"),
}

# The JSON file of a study's or sweep's numbers.
NUMBERS = {
    "a link to a secret": (link("secret"), OUT),
    "a link to zeros": (link("/dev/zero"), OUT),
    "a link that leads nowhere": (link("nothing"), "lgvi-warp:"),
    "a link to itself": (to_itself, "lgvi-warp:"),
    "a link beside it": (moved_beside, None),
    "a pipe": (pipe, "is a named pipe"),
    "a socket": (bound, "is a socket"),
    "a folder": (folder, "is a folder"),
    "50 GB": (GB50, "more than the 64.0 MB"),
    "nested 200,000 deep": (nested(200_000), "is nested too deep"),
    "nested 900 deep": (nested(900), "is nested too deep"),
    "a list": (content(b"[]"), DAMAGED),
    "a number": (content(b"3"), DAMAGED),
    "a number of 5,000 digits": (content(b"9" * 5000), DAMAGED),
    "no JSON": (content(b"time,depth\n"), DAMAGED),
    "not UTF-8": (content(bytes(range(256))), "is not a text in UTF-8"),
    "empty": (content(b""), DAMAGED),
    "half": (torn(0.5), DAMAGED),
}
STUDIES = ("tradeoff", "sensitivity", "stability", "sweep")
TELLING = "\x1b]0;x\x07\x1b[2J"
ESCAPES = TELLING.encode() + b"\xc2\x9b2J"

# Folders of studies, sweeps and results: file, how it is harmed, what `lgvi-warp info` says.
FOLDERS = {
    "tradeoff: other names": ("tradeoff.json", other_keys(of=["\x1b[2J"]), None),
    "tradeoff: messages are a number": ("tradeoff.json", other_keys(messages=7), DAMAGED),
    "tradeoff: units write on the terminal": ("tradeoff.json", other_keys(messages=["\x1b]0;x\x07"]), None),
    "tradeoff: the table is a link": ("tradeoff.csv", link("secret"), None),
    "tradeoff: the table is a pipe": ("tradeoff.csv", pipe, None),
    "tradeoff: the table has a long field": ("tradeoff.csv", content(b"a" * 200_000), None),
    "tradeoff: the table is not a text": ("tradeoff.csv", content(bytes(range(256))), None),
    "tradeoff: the table has zero bytes": ("tradeoff.csv", content(b"a,b\n\0,\0\n"), None),
    "tradeoff: the table has 50 GB": ("tradeoff.csv", GB50, None),
    "tradeoff: a picture is a link": ("x.png", link("secret"), None),
    "tradeoff: a picture is a link to zeros": ("x.png", link("/dev/zero"), None),
    "tradeoff: a picture is a pipe": ("x.png", pipe, None),
    "tradeoff: a picture has 200 names": ("x.png", often(10**7, 200), None),
    "tradeoff: a picture has 50 GB": ("x.png", GB50, None),
    "tradeoff: a name writes on the terminal": (f"{TELLING}.png", content(b"x"), None),
    "tradeoff: a name of two lines": ("a\nb.csv", content(b"x"), None),
    "sensitivity: 10^5 names each": ("sensitivity.json",
        other_keys(quantities=["q"] * 10**5, factors=["f"] * 10**5), "rows for 100,000 quantities"),
    "sensitivity: another analysis": ("sensitivity.json", other_keys(name="evil_module"), "is not an analysis"),
    "stability: texts for numbers": ("stability.json", other_keys(classes={"psi": [["x"]]}), DAMAGED),
    "stability: a class nobody knows": ("stability.json", other_keys(classes={"psi": [[9**9, 3]]}), None),
    "stability: no methods": ("stability.json", other_keys(classes={}), None),
    "sweep: the summary writes on the terminal": ("summary.md", content(ESCAPES), None),
    "sweep: the summary is a link": ("summary.md", link("secret"), OUT),
    "sweep: the summary is a pipe": ("summary.md", pipe, "is a named pipe"),
    "sweep: the summary has 50 GB": ("summary.md", GB50, "more than the 16.8 MB"),
    "sweep: no summary": ("summary.md", removed, "No such file"),
    "sweep: a list": ("sweep.json", content(b"[]"), None),
    "sweep: a number": ("sweep.json", content(b"3"), None),
    "result: a part is a link": ("result_part.npz", link("secret"), OUT),
    "result: a store is a link": ("run.zarr", link("work"), LINKED),
    "result: a store is a pipe": ("run.zarr", pipe, "run.zarr"),
}  # fmt: skip

# All of them: name -> kind of folder that is copied, its harm, what `lgvi-warp info` says.
ROWS = (
    {f"store: {name}": ("store", at("run.zarr", harm), says) for name, (harm, says) in STORES.items()}
    | {f"result: {name}": ("result", at("result.npz", harm), says) for name, (harm, says) in RESULTS.items()}
    | {f"{study}: {name}": (study, at(f"{study}.json", harm), says)
       for study in STUDIES for name, (harm, says) in NUMBERS.items()}
    | {name: (name.partition(":")[0], at(file, harm), says) for name, (file, harm, says) in FOLDERS.items()}
)  # fmt: skip

# Each file of a cell of a sweep: how it is damaged. All of them are run anew, with the same bytes.
CELLS = {
    **{f"torn at {share}": torn(share) for share in (0.0, 0.001, 0.5, 0.999)},
    "no .npz": content(b"time,depth\n"),
    "changed within": flipped,
    "a compressed bomb": bomb("words.npy"),
    "a pickle": zipped(**{"words.npy": pickled}),
    "73 TiB": zipped(**{"words.npy": HUGE, "status.npy": HUGE, "numbers.npy": HUGE}),
    "words of 10^15 times nothing": zipped(**{"words.npy": HUGE_OF_NOTHING}),
    "fewer members": arrays(status=lambda old: old[:-1], numbers=lambda old: old[:, :-1]),
    "no members": arrays(status=lambda old: old[:0], numbers=lambda old: old[:, :0]),
    "a status of texts": arrays(status=lambda old: old.astype(str)),
    "a status nobody knows": arrays(status=lambda old: np.full_like(old, 250)),
    "another status": arrays(status=lambda old: old + np.uint8(1)),
    "numbers of three dimensions": arrays(numbers=lambda old: old[None]),
    "numbers of another length": arrays(numbers=lambda old: old[:, :3]),
    "numbers of NaN": arrays(numbers=lambda old: np.full_like(old, np.nan)),
    "one number is another": arrays(numbers=lambda old: old + (np.arange(old.size) == 0).reshape(old.shape)),
    "other metrics": words(metrics=["evil_module"]),
    "metrics that are none": words(metrics=7),
    "other messages": words(messages=["\x1b[2J all is well"]),
    "messages that are none": words(messages={"a": 1}),
    "another checksum": words(crc32=0),
    "no checksum": words(crc32=None),
    "words nested 200,000 deep": arrays(words=np.frombuffer(b"[" * 200_000, np.uint8)),
    "no words": arrays(words=None),
}
