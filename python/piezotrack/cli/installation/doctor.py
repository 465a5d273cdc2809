"""``piezotrack doctor``: the installation, and whether it calculates as it should."""

from __future__ import annotations

import os
import platform
import re
import time
from importlib import metadata
from typing import Any

import click

from ..command import command
from ..output import Printing

__all__ = ["doctor_command"]

# Exit code where the self-test fails; 1 and 2 are those of errors.
FAILED = 3
NEEDED, MISSING = "needed", "not installed"
EXTRA = re.compile(r"([\w.-]+).*;\s*extra == ['\"]([\w-]+)['\"]")


@command()
def doctor_command(*, printing: Printing) -> None:
    """Check the installation.

    Versions, vector instructions, optional packages and the drivers of devices; a self-test
    compares calculations bit by bit with those of every other computer. The exit code is 3 if they
    differ.
    """
    from ... import _core
    from .self_test import EXPECTED, self_test

    began = time.perf_counter()
    digests = self_test()
    differing = [name for name, digest in digests.items() if digest != EXPECTED[name]]
    document = {
        "format": "piezotrack-doctor",
        "schema_version": 1,
        "piezotrack": _core.__version__,
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "vector_instructions": _core.INSTRUCTION_SET,
        "processors": os.cpu_count(),
        "packages": _packages(),
        "devices": _devices(),
        "self_test": {
            "passed": not differing,
            "differing": differing,
            "seconds": round(time.perf_counter() - began, 2),
            "digests": digests,
        },
    }
    printing.show(_summary(document), document)
    if differing:
        raise click.exceptions.Exit(FAILED)


def _packages() -> dict[str, dict[str, str | None]]:
    """Return the versions of the packages, by the extra that installs them."""
    packages: dict[str, dict[str, str | None]] = {}
    for line in metadata.requires("piezotrack") or ():
        match = EXTRA.match(line)
        name = match[1] if match else re.split(r"[^\w.-]", line, maxsplit=1)[0]
        extra = match[2] if match else NEEDED
        if name != "piezotrack":
            packages.setdefault(extra, {})[name] = _version(name)
    return packages


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _devices() -> dict[str, str]:
    """Return, for each scheme of addresses, whether its devices can be connected to."""
    from ...hardware.addresses import GROUP, schemes

    found = {}
    for scheme in schemes():
        (entry, *_) = metadata.entry_points(group=GROUP, name=scheme)
        try:
            # Of somebody else's package, perhaps: it may raise anything.
            entry.load()
            found[scheme] = "ready" if scheme != "ni" else _ni_driver()
        except Exception as error:
            found[scheme] = f"not ready: {str(error).partition('. ')[0] or type(error).__name__}"
    return found


def _ni_driver() -> str:
    """Return the version of the driver of NI, or that it is missing."""
    try:
        from nidaqmx.system import System
    except ImportError:
        return "nidaqmx is not installed: pip install 'piezotrack[ni]'"
    version = System.local().driver_version
    return f"ready, NI-DAQmx {version.major_version}.{version.minor_version}"


def _summary(document: dict[str, Any]) -> str:
    test, packages = document["self_test"], dict(document["packages"])
    lines = [
        f"piezotrack {document['piezotrack']}, Python {document['python']}, {document['system']}",
        f"{document['processors']} processors, vector instructions: "
        f"{document['vector_instructions']}",
        ", ".join(f"{name} {version or MISSING}" for name, version in packages.pop(NEEDED).items()),
        "",
        "extras",
        *(f"  {extra:<12}  {_extra(extra, found)}" for extra, found in packages.items()),
        "devices",
        *(f"  {scheme:<12}  {state}" for scheme, state in document["devices"].items()),
        "",
    ]
    if test["passed"]:
        names = ", ".join(test["digests"])
        lines.append(f"self-test passed in {test['seconds']:g} s, bit for bit: {names}")
    else:
        lines.append(f"self-test FAILED: {', '.join(test['differing'])} gave other numbers")
    return "\n".join(lines)


def _extra(name: str, found: dict[str, str | None]) -> str:
    have = ", ".join(f"{one} {version}" for one, version in found.items() if version)
    lack = "" if all(found.values()) else f"not installed: pip install 'piezotrack[{name}]'"
    return "; ".join(part for part in (have, lack) if part)
