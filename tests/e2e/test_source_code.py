"""What the code never does: run, or unpickle, what an input says."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.data_paths import ROOT

FILES = sorted(path for package in ("replay", "mapmerge") for path in (ROOT / package).rglob("*.py"))
# Modules that turn bytes into objects of any kind, or into code; those that start programs; those that reach out.
MODULES = {
    *("pickle", "_pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "code", "codeop", "runpy"),
    *("subprocess", "pty", "multiprocessing", "xml", "lxml"),
    *("socket", "ssl", "asyncio", "http", "urllib", "ftplib", "smtplib", "xmlrpc", "requests", "webbrowser"),
}
# XML is written, and never read: what reads it can be made to take any memory.
WRITERS = {"xml.etree.ElementTree": {"Element", "SubElement", "indent", "tostring"}}
BUILT_IN = {"eval", "exec", "compile", "__import__", "input", "breakpoint"}
METHODS = {
    *("os.system", "os.popen", "os.startfile", "os.fork", "os.posix_spawn", "os.posix_spawnp"),
    *("yaml.load", "yaml.unsafe_load", "yaml.full_load", "np.fromregex", "np.memmap", "torch.load"),
    *("tarfile.open", "shutil.unpack_archive", "zipfile.ZipFile"),
}
# The viewer of the Rerun library is a program of its own, which is started when it is asked for, with paths of files.
ALLOWED = {"replay/viewer.py": {"socket", "subprocess"}}


def offences(text: str) -> list[str]:
    """Return what of a module's code is forbidden, with its lines."""
    return [f"line {node.lineno}: {what}" for node in ast.walk(ast.parse(text)) for what in _of(node)]


def _of(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (each.name for each in node.names if each.name.partition(".")[0] in MODULES)
    elif isinstance(node, ast.ImportFrom) and not node.level:
        writes = {each.name for each in node.names} <= WRITERS.get(node.module or "", set())
        if (node.module or "").partition(".")[0] in MODULES and not writes:
            yield node.module or ""
        yield from (f"{node.module}.{each.name}" for each in node.names if f"{node.module}.{each.name}" in METHODS)
    elif isinstance(node, ast.Call):
        yield from _of_call(node)


def _of_call(node: ast.Call) -> Iterator[str]:
    name, given = ast.unparse(node.func), {each.arg: each.value for each in node.keywords}
    if name in BUILT_IN or name in METHODS or name.startswith(("os.exec", "os.spawn")):
        yield name
    if name.startswith("ctypes.") or name == "importlib.reload":
        yield name
    if (
        name.rpartition(".")[2] == "load"
        and name.startswith(("np.", "numpy."))
        and not _is(given, "allow_pickle", False)
    ):
        yield f"{name} that may unpickle"
    if name.rpartition(".")[2] == "YAML" and not _is(given, "typ", "safe"):
        yield "YAML that is not safe"
    if "shell" in given:
        yield f"{name} with a shell"


def _is(given: dict[str | None, ast.expr], name: str, value: object) -> bool:
    found = given.get(name)
    return isinstance(found, ast.Constant) and found.value == value


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_nothing_of_an_input_is_run(path: Path) -> None:
    found = {offence.rpartition(": ")[2] for offence in offences(path.read_text(encoding="utf-8"))}
    assert found == ALLOWED.get(path.relative_to(ROOT).as_posix(), set())


def test_there_is_code_to_look_at() -> None:
    assert len(FILES) > 100


@pytest.mark.parametrize(
    "code",
    [
        "import pickle",
        "from marshal import loads",
        "import xml.etree.ElementTree",
        "from xml.etree.ElementTree import Element, fromstring",
        "from os import system",
        "eval(text)",
        "exec(text)",
        "__import__(name)",
        "os.system(text)",
        "os.execv(name, [])",
        "np.load(path)",
        "np.load(path, allow_pickle=True)",
        "numpy.load(path, None, True)",
        "YAML()",
        "YAML(typ='unsafe')",
        "ruamel.yaml.YAML(typ='rt')",
        "run(text, shell=True)",
        "def inner():\n    import socket",
    ],
)
def test_what_is_forbidden_is_found(code: str) -> None:
    assert len(offences(code)) == 1


@pytest.mark.parametrize(
    "code",
    [
        "np.load(path, allow_pickle=False)",
        "YAML(typ='safe', pure=True)",
        "re.compile('a')",
        "from xml.etree.ElementTree import Element, tostring",
    ],
)
def test_what_is_allowed_is_not(code: str) -> None:
    assert offences(code) == []
