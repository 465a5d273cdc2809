"""The command inside this process: it answers, or refuses in one sentence, without a traceback."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fuzzing import fuzz
from mutants import models
from shells import faults_of_command, invocations
from soak import Script, Tally

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("_no_pictures")]

# Calls of the command, of the files that the readers are given.
SHARE = 0.1


@pytest.mark.parametrize("part", range(2))
def test_a_command_answers_or_refuses(
    part: int, request: pytest.FixtureRequest, record_property: Any, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    tally = Tally(f"commands, part {part + 1}")

    given = invocations(models())

    def body(_: Script, draw: Any) -> None:
        arguments, files = draw(given)
        for name, content in files.items():
            Path(name).write_text(content, encoding="utf-8", errors="surrogatepass")
        faults, code = faults_of_command(arguments)
        tally.tries += 1
        tally.accepted += code == 0
        tally.refused += code == 2
        for fault in faults:
            find = {"arguments": arguments, "files": files}
            tally.fail(f"{arguments[0]}: {fault}", json.dumps(find))

    calls = int(request.config.getoption("--soak-files") * SHARE / 2)
    fuzz(tally, body, calls=calls, start=request.config.getoption("--soak-seed"))
    record_property("tally", tally.row())
    tally.verdict()
