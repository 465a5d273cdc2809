"""All of a release but the uploads: ``make release-check``, or one of its checks, ``ONLY=sbom``.

It builds in target/release-check, prints a table (done, FAILED, not possible here, why) and writes
it to target/release-check/table.md. The exit code is 1 where a check fails.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "target" / "release-check"
BIN = Path(sys.executable).parent
LARGEST = 8_000_000
VERSION: str = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
# What this system cannot do, or what takes hours, and where it is done.
ELSEWHERE = {
    "wheels of other systems": "macOS, Windows, aarch64, musl: built and tested by release.yml",
    "newer Pythons": "3.12 to 3.15 and 3.14t: tested by release.yml",
    "long fuzz runs": "make fuzz CALLS=500000 FILES=150000 and make fuzz-guided: by weekly.yml",
    "coverage": "make coverage: by ci.yml",
    "uploads": "package index, crates.io, release, site: by release.yml, on a tag",
}


class Impossible(Exception):  # noqa: N818 - no error
    """A check that cannot be done here, with the reason."""


def run(*command: object, cwd: Path = ROOT, env: dict[str, str] | None = None) -> str:
    """Run a command and return what it prints; its last lines go into the table where it fails."""
    done = subprocess.run(
        [str(part) for part in command], cwd=cwd, env=env, text=True, capture_output=True
    )
    if done.returncode:
        lines = (done.stdout + done.stderr).strip().splitlines()
        raise AssertionError(f"{command[0]} ended with {done.returncode}: {' | '.join(lines[-6:])}")
    return done.stdout


def tool(name: str) -> Path:
    """Return a program of the virtual environment or of the system."""
    found = BIN / name if (BIN / name).exists() else shutil.which(name)
    if found is None:
        raise Impossible(f"{name} is not installed")
    return Path(found)


def built(where: str, commit: str = "HEAD") -> Path:
    """Build wheel and source distribution of a commit from nothing; return their folder.

    Always at one place: the list of crates in the wheel has the name of the folder.
    """
    if (result := WORK / where).exists():
        return result
    folder = WORK / "build" / "piezotrack"
    shutil.rmtree(folder, ignore_errors=True)
    run("git", "clone", "--quiet", ROOT, folder)
    run("git", "checkout", "--quiet", run("git", "rev-parse", commit).strip(), cwd=folder)
    epoch = run("git", "log", "-1", "--format=%ct", cwd=folder).strip()
    env = {**os.environ, "SOURCE_DATE_EPOCH": epoch, "CARGO_TARGET_DIR": str(folder / "target")}
    run(BIN / "maturin", "sdist", "--out", "dist", cwd=folder, env=env)
    run(BIN / "maturin", "build", "--release", "--locked", "--out", "dist", cwd=folder, env=env)
    (folder / "dist").rename(result)
    shutil.rmtree(folder)
    return result


def wheel(where: str = "first") -> Path:
    """Return the wheel."""
    (found,) = built(where).glob("*.whl")
    return found


def files_of(archive: Path) -> list[str]:
    """List the files of a wheel or a source distribution."""
    if archive.suffix == ".whl":
        return zipfile.ZipFile(archive).namelist()
    return tarfile.open(archive).getnames()


def version() -> str:
    """Compare tag, version, changelog, citation and recipe."""
    run(BIN / "pytest", "-q", "tests/test_release.py")
    tags = run("git", "tag", "--points-at", "HEAD").split()
    assert not tags or f"v{VERSION}" in tags, f"the tags of this commit are {tags}"
    return f"{VERSION}, {'tagged' if tags else 'no tag yet'}"


def public() -> str:
    """Compare the public names with the last release: the changelog mentions what differs."""
    run(BIN / "pytest", "-q", "tests/test_public.py")
    tags = run("git", "tag", "--list", "v*", "--sort=-version:refname").split()
    before = [tag for tag in tags if tag != f"v{VERSION}"]
    if not before:
        return "the snapshot agrees; there is no earlier release to compare with"
    sys.path[:0] = [str(ROOT / "tests/helpers"), str(ROOT / "docs/extensions")]
    from public_names import SNAPSHOT, unannounced

    name = SNAPSHOT.relative_to(ROOT).as_posix()
    old = run("git", "show", f"{before[0]}:{name}").splitlines()
    entry = (ROOT / "CHANGELOG.md").read_text().split("\n## [")[1]
    left = unannounced(old, SNAPSHOT.read_text().splitlines(), entry)
    assert not left, f"changed since {before[0]}, and not in the changelog: {', '.join(left)}"
    return f"compared with {before[0]}"


def notices() -> str:
    """Look for the licences of what is linked in, in wheel and source distribution."""
    run(BIN / "pytest", "-q", "tests/test_notices.py")
    text = (ROOT / "THIRD-PARTY.txt").read_bytes()
    content = zipfile.ZipFile(wheel())
    (name,) = [one for one in content.namelist() if one.endswith("licenses/THIRD-PARTY.txt")]
    assert content.read(name) == text
    (sdist,) = built("first").glob("*.tar.gz")
    assert any(one.endswith("THIRD-PARTY.txt") for one in files_of(sdist))
    return f"{text.count(b': ')} lines of crates and licences, in wheel and source distribution"


def sbom() -> str:
    """Compare the crates that the wheel lists, in CycloneDX, with those of the notices."""
    content = zipfile.ZipFile(wheel())
    names = [one for one in content.namelist() if ".dist-info/sboms/" in one]
    assert names, "no SBOM in the wheel"
    listed = set()
    for name in names:
        document = json.loads(content.read(name))
        assert document["bomFormat"] == "CycloneDX"
        listed |= {f"{one['name']} {one['version']}" for one in document["components"]}
    text = (ROOT / "THIRD-PARTY.txt").read_text()
    ours = set(re.findall(r"^([\w-]+ \d\S*): ", text, re.MULTILINE))
    assert "nalgebra" in {one.split()[0] for one in listed}
    # The notices cover all systems and the C library, the SBOM also what builds and derives.
    return f"{len(listed)} components, {len(listed & ours)} of the {len(ours)} of the notices"


def size() -> str:
    """Check that the wheel is small, of the stable interface, and soon imported."""
    found = wheel()
    assert "cp311-abi3-" in found.name, found.name
    assert found.stat().st_size < LARGEST, f"{found.stat().st_size} bytes"
    python = clean_environment()
    times = []
    for _ in range(7):
        began = time.perf_counter()
        run(python, "-c", "import piezotrack", env=bare())
        times.append(time.perf_counter() - began)
    bytes_ = found.stat().st_size
    return f"{found.name}, {bytes_ / 1e6:.2f} MB, import in {1e3 * sorted(times)[3]:.0f} ms"


def same_bytes() -> str:
    """Compare two builds of this commit, and two of the one before, byte by byte."""
    return "; ".join(
        f"{commit}: {digests(built(f'first{place}', commit), built(f'second{place}', commit))}"
        for commit, place in (("HEAD", ""), ("HEAD~1", "-before"))
    )


def digests(one: Path, other: Path) -> str:
    """Return the beginnings of the SHA-256 of two builds that are the same."""
    told = []
    for archive in sorted(one.iterdir()):
        paths = [folder / archive.name for folder in (one, other)]
        first, second = (hashlib.sha256(path.read_bytes()).hexdigest() for path in paths)
        if first != second and archive.suffix == ".whl":
            a, b = map(zipfile.ZipFile, paths)
            names = [n for n in a.namelist() if a.read(n) != b.read(n)]
            raise AssertionError(f"{archive.name} differs in {names or 'its order or times'}")
        assert first == second, f"{archive.name} differs"
        told.append(f"{archive.suffix} {first[:12]}")
    return ", ".join(told)


def bare() -> dict[str, str]:
    """Return an environment without cargo and compiler, and with a home of nobody."""
    home = WORK / "home"
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    # pip has to find its index all the same.
    kept = {name: text for name, text in os.environ.items() if name.startswith("PIP_")}
    return {"HOME": str(home), "PATH": str(WORK / "nothing"), "LANG": "C.UTF-8", **kept}


def clean_environment() -> Path:
    """Install the wheel in an environment of its own, from a bare one; return its Python."""
    python = WORK / "clean" / "bin" / "python"
    if not python.exists():
        run(sys.executable, "-m", "venv", WORK / "clean")
        run(
            python, "-m", "pip", "install", "--quiet", "--only-binary", ":all:", wheel(), env=bare()
        )
    return python


def stranger() -> str:
    """Install the wheel in a bare environment, and run what the README shows."""
    python = clean_environment()
    env = bare()
    with tempfile.TemporaryDirectory() as folder:
        where = Path(folder)
        run(python, "-m", "piezotrack", "doctor", cwd=where, env=env)
        run(python, "-m", "piezotrack", "demo", "--out", "demo", cwd=where, env=env)
        text = (ROOT / "README.md").read_text()
        commands = re.findall(r"^\$ piezotrack ((?:.*\\\n)*.*)$", text, re.MULTILINE)
        for command in commands:
            arguments = shlex.split(command.replace("\\\n", " "))
            run(python, "-m", "piezotrack", *arguments, cwd=where, env=env)
        blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
        for block in blocks:
            run(python, "-c", block, cwd=where, env=env)
    assert commands
    assert blocks
    return f"doctor, demo, {len(commands)} commands and {len(blocks)} block of the README"


def oldest() -> str:
    """Install and run with the oldest packages that pyproject.toml allows."""
    uv = tool("uv")
    python = WORK / "oldest" / "bin" / "python"
    shutil.rmtree(WORK / "oldest", ignore_errors=True)
    run(sys.executable, "-m", "venv", WORK / "oldest")
    # Dependencies of a wheel are direct ones where pyproject.toml is given too.
    options = ("--resolution", "lowest-direct", "--requirements", ROOT / "pyproject.toml")
    run(uv, "pip", "install", "--quiet", "--python", python, *options, wheel())
    document = json.loads(run(python, "-m", "piezotrack", "doctor", "--json", cwd=WORK))
    with tempfile.TemporaryDirectory() as folder:
        run(python, "-m", "piezotrack", "demo", "--out", "demo", cwd=Path(folder))
    return ", ".join(f"{name} {text}" for name, text in document["packages"]["needed"].items())


def free_threaded() -> str:
    """Compile the module for Python 3.14 without the GIL."""
    WORK.mkdir(parents=True, exist_ok=True)
    settings = WORK / "python314t.txt"
    settings.write_text(
        "implementation=CPython\nversion=3.14\nshared=true\nabi3=false\nlib_name=python3.14t\n"
        "pointer_width=64\nbuild_flags=Py_GIL_DISABLED\nsuppress_build_script_link_lines=false\n"
    )
    env = {**os.environ, "PYO3_CONFIG_FILE": str(settings)}
    env["CARGO_TARGET_DIR"] = str(WORK / "free-threaded")
    run("cargo", "check", "--quiet", "--locked", "--package", "piezotrack-py", env=env)
    return "checked by the compiler, not run: no such Python is here"


def crate() -> str:
    """Pack the control crate, and build it from what is packed."""
    options = ("--quiet", "--locked", "--allow-dirty", "--target-dir", WORK / "crate")
    run("cargo", "publish", "--dry-run", *options, "--package", "piezotrack-control")
    # Newer versions of cargo leave it in a folder of their own.
    packed = next((WORK / "crate" / "package").rglob("piezotrack-control-*.crate"))
    return f"{packed.name}, {packed.stat().st_size / 1e3:.0f} kB"


def semver() -> str:
    """Compare the public items of the control crate with those of its version before."""
    tags = run("git", "tag", "--list", "v*", "--sort=-version:refname").split()
    before = [tag for tag in tags if tag != f"v{VERSION}"]
    if shutil.which("cargo-semver-checks") is None:
        raise Impossible("cargo install --locked cargo-semver-checks")
    baseline = before[0] if before else "HEAD"
    run("cargo", "semver-checks", "--package", "piezotrack-control", "--baseline-rev", baseline)
    return f"compared with {before[0]}" if before else "no earlier release: compared with itself"


def crates() -> str:
    """Compare licences and sources of the crates with what deny.toml allows."""
    if shutil.which("cargo-deny") is None:
        raise Impossible("cargo install --locked cargo-deny")
    run("cargo", "deny", "--offline", "--locked", "check", "licenses", "bans", "sources")
    return "licences, bans, sources; advisories by ci.yml, which fetches their database"


def workflows() -> str:
    """Look for weaknesses and faults of form in the workflows."""
    files = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
    run(tool("zizmor"), "--offline", "--quiet", "--persona=pedantic", ".github")
    check = tool("check-jsonschema")
    run(check, "--builtin-schema", "vendor.github-workflows", *files)
    run(check, "--builtin-schema", "vendor.dependabot", ROOT / ".github" / "dependabot.yml")
    if shutil.which("actionlint"):
        run("actionlint", *files)
        return f"zizmor, schemas and actionlint: {len(files)} workflows"
    return f"zizmor and schemas: {len(files)} workflows; actionlint is not here"


CHECKS: dict[str, Callable[[], str]] = {
    "version": version,
    "public": public,
    "notices": notices,
    "sbom": sbom,
    "size": size,
    "same-bytes": same_bytes,
    "stranger": stranger,
    "oldest": oldest,
    "free-threaded": free_threaded,
    "crate": crate,
    "semver": semver,
    "crates": crates,
    "workflows": workflows,
}


def main(only: list[str]) -> int:
    """Run the checks and print the table; return the exit code."""
    if unknown := set(only) - CHECKS.keys():
        raise SystemExit(f"no check {', '.join(sorted(unknown))}: expected {', '.join(CHECKS)}")
    for folder in ("first", "second", "first-before", "second-before", "clean"):
        shutil.rmtree(WORK / folder, ignore_errors=True)
    rows, failed = [], False
    for name in only or CHECKS:
        began = time.perf_counter()
        try:
            state, told = "done", CHECKS[name]()
        except Impossible as reason:
            state, told = "not possible here", str(reason)
        except AssertionError as error:
            state, told, failed = "FAILED", str(error), True
        rows.append((name, state, told))
        print(f"{name:<14} {state:<18} {told}  [{time.perf_counter() - began:.0f} s]", flush=True)
    if not only:
        rows += [(name, "not possible here", told) for name, told in ELSEWHERE.items()]
        for name, state, told in rows[-len(ELSEWHERE) :]:
            print(f"{name:<14} {state:<18} {told}")
    table = ["| check | state | result |", "| --- | --- | --- |"]
    table += [f"| {' | '.join(row)} |" for row in rows]
    WORK.mkdir(parents=True, exist_ok=True)
    (WORK / "table.md").write_text("\n".join(table) + "\n", encoding="utf-8")
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
