"""Read the profiles of instrumented crates: what `make coverage` counted of Rust, in lcov's format.

    python .ci/profiles.py target/coverage > target/coverage/rust.lcov

The folder has ``profiles/``, ``built.json`` (what cargo says of the tests it built) and ``venv/``,
where the instrumented module is installed.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path


def output(*command: str | Path) -> str:
    """Return what a program prints."""
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, encoding="utf-8").stdout


def llvm() -> Path:
    """Find LLVM's readers of profiles: the toolchain's own, else those beside coverage.py."""
    sysroot = Path(output("rustc", "--print", "sysroot").strip())
    places = [
        *sysroot.glob("lib/rustlib/*/bin/llvm-cov"),
        *Path(sys.prefix).glob("lib/python*/site-packages/llvm/bin/llvm-cov"),
    ]
    if not places:
        sys.exit("there is no llvm-cov; to have it: rustup component add llvm-tools")
    return places[0].parent


def main() -> None:
    """Merge the profiles, and print the counts of all programs and of the module."""
    folder, tools = Path(sys.argv[1]), llvm()
    built = [json.loads(one) for one in (folder / "built.json").read_text("utf-8").splitlines()]
    programs = sorted({one["executable"] for one in built if one.get("executable")})
    module = next((folder / "venv").glob("lib/python*/site-packages/piezotrack/_core*.so"))
    merged, profiles = folder / "merged.profdata", (folder / "profiles").glob("*.profraw")
    output(tools / "llvm-profdata", "merge", "--sparse", "--output", merged, *profiles)
    objects = [word for one in programs for word in ("--object", one)]
    command = ("export", "--format=lcov", "--skip-functions", "--instr-profile", merged)
    print(output(tools / "llvm-cov", *command, module, *objects), end="")


if __name__ == "__main__":
    main()
