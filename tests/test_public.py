"""Public names change only with a line in the changelog."""

from __future__ import annotations

import pytest

from piezotrack._support.deprecated import deprecated
from public_names import SNAPSHOT, public_names, unannounced


def test_the_public_names_are_those_of_the_snapshot() -> None:
    known = SNAPSHOT.read_text(encoding="utf-8").splitlines()
    now = public_names()
    differing = sorted(set(known) ^ set(now))
    assert not differing, "`make public-names` writes them; the changelog has to mention each"


def test_a_change_that_the_changelog_does_not_mention_is_found() -> None:
    before = ["piezotrack.tune(stage, *, seed=0)", "piezotrack.old(x)", "piezotrack.Pid.kp"]
    after = ["piezotrack.tune(stage, *, seed=1)", "piezotrack.new(x)", "piezotrack.Pid.kp"]
    entry = "- `old` is called `new` now."
    assert unannounced(before, after, entry) == ["piezotrack.tune"]
    assert unannounced(before, before, "") == []


def test_a_deprecated_function_works_and_names_what_to_type() -> None:
    @deprecated("pt.tune", since="0.2.0")
    def search(gain: float) -> float:
        return 2.0 * gain

    with pytest.warns(DeprecationWarning, match=r"search .*0\.2\.0.*pt\.tune") as warned:
        assert search(3.0) == 6.0
    # Of the line that is to be changed, so that Python shows it to the one who wrote it.
    assert warned[0].filename == __file__


def test_a_deprecated_class_stays_a_class() -> None:
    @deprecated("Notch", since="0.2.0")
    class Filter:
        def __init__(self, frequency: float) -> None:
            self.frequency = frequency

    class Own(Filter):
        pass

    with pytest.warns(DeprecationWarning, match="Filter"):
        assert Filter(5.0).frequency == 5.0
    assert Own(6.0).frequency == 6.0
