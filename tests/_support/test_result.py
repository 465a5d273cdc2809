"""Results: each has its text and its picture, under the same names."""

from __future__ import annotations

import inspect
import pkgutil
from importlib import import_module

import piezotrack as pt
from piezotrack._support.display.result import Result, Viewed


def classes() -> list[type[Viewed]]:
    """All classes with views."""
    for module in pkgutil.walk_packages(pt.__path__, "piezotrack."):
        if not module.name.endswith("__main__"):
            import_module(module.name)
    known: set[type[Viewed]] = {Viewed}
    while more := {below for one in known for below in one.__subclasses__()} - known:
        known |= more
    packaged = {one for one in known if one.__module__.startswith("piezotrack.")}
    return sorted(packaged - {Viewed, Result}, key=lambda one: one.__name__)


def test_every_view_of_every_result_is_there() -> None:
    """Each takes the result first, and `plot` a figure."""
    assert classes()
    for result in classes():
        expected = {"summary", "plot"} if issubclass(result, Result) else {"html", "plot"}
        assert expected <= set(result.views), result
        for name in result.views:
            parameters = list(inspect.signature(result.view(name)).parameters)
            assert parameters, (result, name)
            if name == "plot":
                assert "fig" in parameters, (result, name)


def test_no_module_has_the_name_of_a_public_name_beside_it() -> None:
    """Importing it would put the module in the place of the function."""
    packages = [module.name for module in pkgutil.walk_packages(pt.__path__, "piezotrack.")
                if module.ispkg]  # fmt: skip
    for name in ["piezotrack", *packages]:
        package = import_module(name)
        public = {n for n in getattr(package, "__all__", ())
                  if not inspect.ismodule(getattr(package, n))}  # fmt: skip
        modules = {module.name for module in pkgutil.iter_modules(package.__path__)}
        assert not public & modules, name
