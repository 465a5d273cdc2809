"""Cache and settings of matplotlib where the home folder cannot be written to."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from commands import COMMAND, log_text
from piezotrack.cli.process.pictures import prepare_pictures

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A home that is a file: nothing can be made in it."""
    for name in ("MPLCONFIGDIR", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MPLBACKEND", "agg")
    file = tmp_path / "home"
    file.write_text("", encoding="utf-8")
    monkeypatch.setenv("HOME", str(file))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return file


@pytest.mark.skipif(os.name == "nt", reason="HOME is that of POSIX")
def test_without_a_home_the_cache_has_a_folder_of_this_user(home: Path, tmp_path: Path) -> None:
    prepare_pictures()
    folder = os.environ.pop("MPLCONFIGDIR")
    assert os.path.dirname(folder) == str(tmp_path)
    status = os.stat(folder)
    assert (status.st_uid, status.st_mode & 0o777) == (os.getuid(), 0o700)
    # The same for the next command, and never one that another has put there.
    prepare_pictures()
    assert os.environ.pop("MPLCONFIGDIR") == folder
    os.rmdir(folder)
    os.symlink(tmp_path, folder)
    prepare_pictures()
    other = os.environ.pop("MPLCONFIGDIR")
    assert other != folder
    assert not os.path.islink(other)
    assert home.read_text(encoding="utf-8") == ""


@pytest.mark.skipif(os.name == "nt", reason="HOME is that of POSIX")
def test_settings_that_can_be_written_stay(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home.unlink()
    prepare_pictures()
    assert "MPLCONFIGDIR" not in os.environ
    monkeypatch.setenv("MPLCONFIGDIR", "mine")
    prepare_pictures()
    assert os.environ["MPLCONFIGDIR"] == "mine"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="matplotlib's places differ")
def test_a_command_without_a_home_prints_nothing_of_it(home: Path, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(log_text(), encoding="utf-8")
    done = subprocess.run(
        [*COMMAND, "noise", "log.csv", "--out", "n"],
        cwd=tmp_path,
        env={**os.environ, "HOME": str(home), "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120.0,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "written to n/: noise.json .png .svg" in done.stdout
