"""Devices of other packages, by their entry points."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

import piezotrack as pt
from distributions import install
from piezotrack.hardware.addresses import schemes

if TYPE_CHECKING:
    from pathlib import Path

CODE = """\
from piezotrack.hardware import connect


def from_address(host, port, path, options):
    device = connect("virtual:")
    device.called_with = (host, port, path, options)
    return device
"""


@pytest.fixture(autouse=True)
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "their_device", raising=False)
    return tmp_path


def declare(folder: Path, name: str) -> None:
    install(
        folder,
        CODE,
        group="piezotrack.devices",
        name=name,
        module="their_device",
        function="from_address",
    )


def test_a_device_of_another_package_is_connected_by_its_scheme(site: Path) -> None:
    declare(site, "lab")
    assert schemes() == ["firmware", "gcs", "ni", "scpi", "virtual", "lab"]
    device = pt.hardware.connect("lab://stage:7/x?limits=0..1V")
    assert vars(device)["called_with"] == ("stage", 7, "/x", {"limits": "0..1V"})


def test_no_package_replaces_a_scheme(site: Path) -> None:
    declare(site, "virtual")
    assert "called_with" not in vars(pt.hardware.connect("virtual:"))
    with pytest.raises(pt.ParameterError, match="device"):
        pt.hardware.connect("lab:")
