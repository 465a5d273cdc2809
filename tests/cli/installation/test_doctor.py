"""``piezotrack doctor``: versions, and a self-test that notices another digit."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

import piezotrack as pt
from commands import ran, run
from piezotrack.cli.installation import self_test

if TYPE_CHECKING:
    import pytest


def test_the_document_has_what_is_installed() -> None:
    document = json.loads(ran("doctor", "--json"))
    assert document["piezotrack"] == pt.__version__
    assert document["packages"]["needed"]["numpy"] == np.__version__
    assert document["vector_instructions"] in ("AVX-512", "AVX2", "NEON", "none")
    assert {"gcs", "scpi", "ni", "virtual"} <= document["devices"].keys()
    assert document["self_test"]["passed"]
    assert document["self_test"]["digests"] == self_test.EXPECTED


def test_a_number_that_differs_in_its_last_bit_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    simulate = pt.DahlStage.simulate

    def simulated(*arguments: object, **named: object) -> object:
        run = simulate(*arguments, **named)  # type: ignore[arg-type]
        run.x[-1] = np.nextafter(run.x[-1], 1.0)
        return run

    monkeypatch.setattr(pt.DahlStage, "simulate", simulated)
    done = run("doctor", "--json")
    assert done.exit_code == 3
    assert json.loads(done.stdout)["self_test"]["differing"] == ["simulation", "search"]


def test_a_package_that_is_missing_is_named_with_what_installs_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from importlib import metadata

    version = metadata.version

    def installed(name: str) -> str:
        if name == "h5py":
            raise metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(metadata, "version", installed)
    monkeypatch.setattr(self_test, "self_test", lambda: self_test.EXPECTED)
    words = ran("doctor", "--verbose")
    assert "pip install 'piezotrack[hdf5]'" in words
    assert json.loads(ran("doctor", "--json"))["packages"]["hdf5"] == {"h5py": None}
