"""README and pages: what they show is typed, in order, and what they link to is there."""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
import subprocess
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib.pyplot as plt
import pytest

import piezotrack as pt
from commands import run
from folders import ROOT
from piezotrack.cli.research.demonstration import demo_logs
from piezotrack.data.log_file import write_log
from piezotrack.identification.fit import identify
from served import serving

if TYPE_CHECKING:
    from collections.abc import Iterator

# Not those that are written when the site is built.
PAGES = sorted([ROOT / "README.md", *ROOT.glob("docs/*.md"), *ROOT.glob("docs/decisions/*.md")])
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]


class Block(NamedTuple):
    """A fenced block of a page: its language, and the line of the page it begins on."""

    language: str
    code: str
    line: int


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    return [
        Block(found[1], found[2], text[: found.start()].count("\n") + 1)
        for found in re.finditer(r"^```(\w*)[^\n]*\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    ]


TYPED = [page for page in PAGES if any(b.language in ("python", "console") for b in blocks(page))]


# Pages whose blocks compute for seconds.
LONG = (
    "control",
    "evidence",
    "firmware",
    "first-controller",
    "hardware",
    "identification",
    "learning",
    "two-axes",
)
MARKED = [
    pytest.param(page, marks=pytest.mark.slow) if page.stem in LONG else page for page in TYPED
]


FITS: dict[str, Any] = {}


def fitted_once(data: Any, *arguments: Any, **options: Any) -> Any:
    """Identify, but the same record once only: README and pages fit the same one."""
    # The command line says what the default is.
    chosen = {key: value for key, value in options.items() if value is not None}
    given = data
    if isinstance(given, pt.Record):
        own = {key: value for key, value in vars(given).items() if value is not None}
        data, chosen = own.pop("data"), {**own, **chosen}
    if not isinstance(data, pt.Dataset):
        return identify(given, *arguments, **options)
    for key, usual in (("offset", True), ("weight", 1.0)):
        if chosen.get(key) == usual:
            del chosen[key]
    record = (data.full.sha256, data.t[0], data.t[-1], data.source)
    key = repr((record, arguments, sorted(chosen.items())))
    if key not in FITS or data.full.duration < 30.0:
        FITS[key] = identify(given, *arguments, **options)
    return FITS[key]


@pytest.mark.parametrize("page", MARKED, ids=lambda page: page.name)
def test_what_a_page_shows_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Type all blocks of a page in one folder: `piezotrack demo` has been there before.

    A block without a language that follows is what is printed: each of its lines has to be.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pt, "identify", fitted_once)
    monkeypatch.setattr("piezotrack.identification.fit.identify", fitted_once)
    Path("demo").mkdir()
    for log, name in zip(demo_logs(), ("log", "other"), strict=True):
        write_log(log, Path("demo", f"{name}.csv"))
    names: dict[str, Any] = {"__name__": "__main__"}
    printed = ""
    with warnings.catch_warnings(), contextlib.ExitStack() as served:
        warnings.simplefilter("error")
        for block in blocks(page):
            where = f"{page.name}:{block.line}"
            if block.language == "python":
                printed = python(block, names, where)
            elif block.language == "console":
                printed = "".join(console(block, where, served))
            elif block.language == "text":
                for line in block.code.splitlines():
                    assert line.strip() in printed, f"{where}: {line}\nis not printed:\n{printed}"
            plt.close("all")


# Where the servers of a page really are, by the addresses in it.
ADDRESSES: dict[str, str] = {}


def python(block: Block, names: dict[str, Any], where: str) -> str:
    """Run a block, with prompts or without; return what it prints."""
    for address, real in ADDRESSES.items():
        block = block._replace(code=block.code.replace(f'"{address}"', f'"{real}"'))
    if ">>>" in block.code:
        report: list[str] = []
        test = doctest.DocTestParser().get_doctest(block.code, names, where, where, 0)
        doctest.DocTestRunner(verbose=False).run(test, out=report.append, clear_globs=False)
        names.update(test.globs)
        assert not report, "".join(report)
        return ""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(block.code, where, "exec"), names)
    return out.getvalue()


def console(block: Block, where: str, served: contextlib.ExitStack) -> Iterator[str]:
    """Type the commands of a block, the lines behind a dollar sign; what they print.

    A server in the background is a process until the end of the page, at any free port.
    """
    for line in block.code.replace("\\\n", "").splitlines():
        if not line.startswith("$ "):
            continue
        name, *arguments = shlex.split(line.removeprefix("$ "), comments=True)
        # Other commands, as pip, are not those of the package; a firmware is made and run.
        if name == "make" and "-C" in arguments:
            subprocess.run([name, *arguments], check=True, capture_output=True)
        elif name.endswith("-host"):
            converters = ADDRESSES["converters://127.0.0.1"].rpartition(":")[2]
            command = [f"./{name}", "0", converters]
            board = served.enter_context(
                subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
            )
            served.callback(board.kill)
            assert board.stdout is not None
            ADDRESSES[f"firmware://127.0.0.1:{arguments[0]}"] = board.stdout.readline().strip()
        elif name == "piezotrack" and arguments[-1] == "&":
            _, protocol, *options = arguments[:-1]
            _, ADDRESSES[f"{protocol}://127.0.0.1"], _ = served.enter_context(
                serving(*options, protocol=protocol)
            )
        elif name == "piezotrack":
            arguments = [ADDRESSES.get(one, one) for one in arguments]
            done = run(*arguments)
            assert done.exit_code == 0, f"{where}: {line}\n{done.output}"
            yield done.stdout


def anchors(page: Path) -> set[str]:
    """The anchors that a page's headings get where it is shown."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles} | set(
        re.findall(r'<a id="([^"]+)">', text)
    )


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_the_pages_link_to_what_is_there(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        # The reference and the gallery are there when the site is built, which checks all links.
        if "://" in target or target.startswith(("reference/", "gallery/")):
            continue
        name, _, anchor = target.partition("#")
        there = (page.parent / name) if name else page
        assert there.exists(), target
        if anchor and there.suffix == ".md":
            assert anchor in anchors(there), target


# Folders of the repository; what is built, as target/, is not in it.
FOLDERS = ("benches", "docs", "python", "rust", "tests", ".ci", ".github")


def named_paths(page: Path) -> list[str]:
    """Paths of the repository that a page names in backticks; NAME in one stands for any name."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    found = re.findall(rf"`((?:{'|'.join(map(re.escape, FOLDERS))})/[\w./*-]+)`", text)
    return sorted({path.replace("NAME", "*") for path in found})


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name)
def test_a_path_that_a_page_names_is_there(page: Path) -> None:
    assert [path for path in named_paths(page) if not any(ROOT.glob(path.rstrip("/")))] == []


def test_the_pages_name_paths(tmp_path: Path) -> None:
    assert len({path for page in PAGES for path in named_paths(page)}) > 20
    (tmp_path / "page.md").write_text("`rust/none.rs` and `python/NAME.py`\n```\n`tests/x`\n```\n")
    assert named_paths(tmp_path / "page.md") == ["python/*.py", "rust/none.rs"]
