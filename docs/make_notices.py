"""Write THIRD-PARTY.txt: licences of the crates that are linked into the wheel and the C library.

Type `make notices`. It needs cargo, which downloads the crates of other systems too.
"""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
NOTICES = ROOT / "THIRD-PARTY.txt"
LIBRARIES = ("piezotrack-py", "piezotrack-capi")
TITLE = """\
Licences of what is linked into the Python module and the C library of piezotrack
==================================================================================

piezotrack itself is under MIT or Apache-2.0, at your option: LICENSE-MIT and LICENSE-APACHE. The
crates below are linked in, on some systems not all of them; where one may be used under several
licences, it is used under the MIT licence. Written by `make notices`.

"""
# Of every program in Rust; its version is that of the compiler, not of Cargo.lock.
STANDARD_LIBRARY = """\
The standard library of Rust is linked in too, under the MIT licence: copyright The Rust Project
Developers. Notices of its parts are in share/doc/rust/COPYRIGHT-library.html of the compiler.
"""

Crate = tuple[str, str]


def linked(*where: str) -> set[Crate]:
    """Names and versions of the crates of other people that are linked into the two libraries.

    Parameters
    ----------
    *where : str
        Options of cargo: ``"--target", "all"`` for all systems, not this one alone.
    """
    packages = [option for name in LIBRARIES for option in ("--package", name)]
    edges = ("--edges", "normal,no-proc-macro", "--prefix", "none", "--format", "{p}")
    lines = cargo("tree", "--locked", *packages, *edges, *where).splitlines()
    crates = {(line.split()[0], line.split()[1].removeprefix("v")) for line in lines if line}
    return {crate for crate in crates if not crate[0].startswith("piezotrack-")}


def cargo(*arguments: str) -> str:
    """Return what cargo prints."""
    return subprocess.run(
        ["cargo", *arguments], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout


def notices() -> str:
    """Return the text of the file."""
    metadata = json.loads(cargo("metadata", "--format-version", "1", "--locked"))
    packages = {(one["name"], one["version"]): one for one in metadata["packages"]}
    crates = sorted(linked("--target", "all"))
    texts: dict[str, tuple[str, list[str]]] = {}
    for crate in crates:
        for text in licences(packages[crate]):
            # Texts that differ in their lines only are the same.
            _, crates_of = texts.setdefault(" ".join(text.split()), (text, []))
            crates_of.append(" ".join(crate))
    lines = [f"{name} {version}: {packages[name, version]['license']}" for name, version in crates]
    parts = [TITLE + "\n".join(lines), STANDARD_LIBRARY + "\n" + granted()]
    parts += [f"{', '.join(crates_of)}\n\n{text}" for text, crates_of in texts.values()]
    return f"\n\n{'-' * 80}\n\n".join(part.strip() for part in parts) + "\n"


def licences(package: dict[str, Any]) -> list[str]:
    """Return the texts under which a crate is used: of its files, or else the usual one."""
    folder = Path(package["manifest_path"]).parent
    names = re.compile(r"(licen[sc]e|copying|notice|copyright)", re.IGNORECASE)
    files = sorted(path for path in folder.iterdir() if path.is_file() and names.match(path.name))
    choice = [path for path in files if "MIT" in path.name.upper() or "NOTICE" in path.name.upper()]
    may_choose = " AND " not in package["license"] and any("MIT" in one.name for one in choice)
    if files:
        return [tidied(path) for path in (choice if may_choose else files)]
    if "MIT" not in package["license"]:
        raise SystemExit(f"{package['name']} has no licence file: add its text by hand")
    authors = ", ".join(re.sub(r"\s*<.*?>", "", name) for name in package["authors"])
    return [f"Copyright (c) {authors or 'the authors of ' + package['name']}\n\n{granted()}"]


def tidied(path: Path) -> str:
    """Return the text of a file without blanks at the ends of lines."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return "\n".join(line.rstrip() for line in lines).strip("\n")


def granted() -> str:
    """Return the MIT licence without its line of the copyright."""
    text = tidied(ROOT / "LICENSE-MIT")
    return text[text.index("Permission is hereby granted") :]


if __name__ == "__main__":
    NOTICES.write_text(notices(), encoding="utf-8")
