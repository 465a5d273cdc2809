"""The same bits from any number of threads, in any process, at any time."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from typing import TYPE_CHECKING

import pytest

from commands import COMMAND
from folders import ROOT

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.slow

DIGESTS = ROOT / "tests" / "helpers" / "digests.py"


@cache
def searched(threads: int, hash_seed: int) -> list[str]:
    """Fingerprints from a process of its own."""
    done = subprocess.run(
        [sys.executable, str(DIGESTS), str(threads)],
        env={**os.environ, "PYTHONHASHSEED": str(hash_seed)},
        capture_output=True, text=True, check=True, timeout=300.0,
    )  # fmt: skip
    return done.stdout.splitlines()


@pytest.mark.parametrize(("threads", "hash_seed"), [(1, 1), (2, 0), (7, 3)])
def test_searches(threads: int, hash_seed: int) -> None:
    assert searched(threads, hash_seed) == searched(1, 0)
    assert len(set(searched(1, 0))) == len(searched(1, 0))


def test_files_of_the_command(tmp_path: Path) -> None:
    folders = []
    for seed in ("0", "5"):
        folder = tmp_path / seed
        # Under the same name, which some results mention.
        folder.mkdir()
        subprocess.run(
            [*COMMAND, "demo", "--paper", "--out", "demo", "--seed", "1"], cwd=folder, check=True,
            capture_output=True, env={**os.environ, "PYTHONHASHSEED": seed}, timeout=300.0,
        )  # fmt: skip
        folders.append({p.relative_to(folder): p.read_bytes() for p in sorted(folder.rglob("*.*"))})
    assert folders[0].keys() == folders[1].keys()
    assert [p for p in folders[0] if folders[0][p] != folders[1][p]] == []
    assert len(folders[0]) > 3
