"""The stage that boards are tested on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(scope="module")
def stage() -> Iterator[pt.hardware.Converters]:
    with pt.hardware.Converters(pt.VirtualStage.xu_li_2010(seed=1)) as converters:
        yield converters
