"""Files of every schema version are read: each version of piezotrack reads those before it."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from folders import ROOT
from piezotrack.control.controller import controller
from piezotrack.errors import DataError
from piezotrack.identification.campaigns import folder
from piezotrack.identification.fitted import model_entries
from piezotrack.multiaxis import modal_model
from piezotrack.response import response_data

if TYPE_CHECKING:
    from pathlib import Path

FILES = ROOT / "tests" / "files"
VOLTS = np.array([0.0, 20.0, 40.0, 20.0])
CURRENT = {
    model_entries.FORMAT: model_entries.SCHEMA_VERSION,
    controller.FORMAT: controller.SCHEMA_VERSION,
    response_data.FORMAT: response_data.SCHEMA_VERSION,
    modal_model.FORMAT: modal_model.SCHEMA_VERSION,
    folder.FORMAT: folder.SCHEMA_VERSION,
}
# No version before was released, and none is read.
FIRST = {folder.FORMAT: 2}


def kept(name: str, version: int) -> list[Path]:
    """List the files of a version of a format."""
    files = [*FILES.glob("*_version_*.json"), *FILES.glob("*_version_*/campaign.json")]
    found = []
    for file in files:
        document = json.loads(file.read_text(encoding="utf-8"))
        if (document["format"], document["schema_version"]) == (name, version):
            found.append(file)
    return found


@pytest.mark.parametrize("name", CURRENT)
def test_there_is_a_file_of_each_version(name: str) -> None:
    for version in range(FIRST.get(name, 1), CURRENT[name] + 1):
        assert kept(name, version), f"{name} of version {version} has no file in tests/files"


@pytest.mark.parametrize("file", sorted(FILES.glob("*_version_*")), ids=lambda one: one.name)
def test_the_name_of_a_file_has_its_version(file: Path) -> None:
    document = json.loads((file / "campaign.json" if file.is_dir() else file).read_text())
    assert re.search(r"_version_(\d+)", file.name)[1] == str(document["schema_version"])  # type: ignore[index]


def test_models_of_both_versions_move() -> None:
    old, new = (pt.load(FILES / f"prandtl_ishlinskii_version_{n}.json") for n in (1, 2))
    for model in (old, new):
        x = model.model.simulate(VOLTS, 1e-2).x
        # On the way down a stage with hysteresis is above its way up.
        assert x[0] < x[1] < x[3] < x[2]


def test_a_controller_acts_as_when_it_was_written() -> None:
    loop = pt.load_controller(FILES / "controller_version_1.json")
    # The integral of an error of 1 um that stays: 0.03 V/um, ti = 20 ms.
    wrong, right = loop.start(), loop.start()
    added = [wrong.step_um(30.0, 29.0) - right.step_um(30.0, 30.0) for _ in range(5)]
    assert np.diff(added) == pytest.approx(0.03 * loop.dt / 0.02)
    assert loop.limits == pytest.approx((0.0, 60.0), abs=6.0)


def test_a_response_has_its_gain() -> None:
    response = pt.load_response(FILES / "response_version_1.json")
    # A mode at 200 Hz raises the gain of 1 um/V by 1 / (1 - (90 / 200)^2) at 90 Hz.
    last = np.abs(response.value[-1] / response.value[0])
    assert last == pytest.approx((1.0 - 0.05**2) / (1.0 - 0.45**2), rel=0.02)


def test_axes_have_their_modes() -> None:
    model = pt.multiaxis.load_axes(FILES / "axes_version_1.json")
    assert [one.level for one in model.levels] == pytest.approx([0.5, 1.0])
    assert model.frequencies() == pytest.approx([180.0, 231.0, 262.0, 540.0, 720.0], rel=1e-4)
    # A push of the first drive at rest: 2.2 um/V at its own sensor, a quarter of it at the next.
    assert model.static_gain()[:2, 0] == pytest.approx([2.225e-6, 0.63e-6], rel=1e-3)


def test_a_campaign_has_its_results() -> None:
    found = pt.identification.Campaign.load(FILES / "campaign_version_2")
    (result,) = found
    assert result.kind == "prandtl-ishlinskii"
    assert 0.0 < result.rms_percent < 0.2


@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("prandtl_ishlinskii_version_2", pt.load),
        ("controller_version_1", pt.load_controller),
        ("response_version_1", pt.load_response),
        ("axes_version_1", pt.multiaxis.load_axes),
    ],
)
def test_a_file_of_a_later_version_is_refused(name: str, read: Any, tmp_path: Path) -> None:
    document = json.loads((FILES / f"{name}.json").read_text())
    document["schema_version"] += 1
    (tmp_path / "later.json").write_text(json.dumps(document))
    with pytest.raises(DataError, match=f"schema_version.*{document['schema_version']}"):
        read(tmp_path / "later.json")
