"""``piezotrack campaign``: many logs, models and seeds, with a file for each result."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...errors import DataError, Interrupted, ParameterError
from ..error_messages import report_errors
from ..interruption import acknowledge_interrupt
from ..option_groups import HeldLogOptions, with_groups
from ..options import Json, Quiet, can_be_folder, refuse_without_effect, windowed
from ..output import Output
from .fit_options import (
    Delay,
    Drift,
    FitOptions,
    History,
    Kinds,
    KindsNamed,
    MethodOptions,
    ParameterOptions,
    Windows,
    delay_asked,
    drift_asked,
    each_of,
    searched,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from concurrent.futures import Executor

__all__ = ["campaign_command"]

PARQUET = "campaign.parquet"


@report_errors
@with_groups
def campaign_command(
    context: typer.Context,
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE", help="Logs of any format, with their units.")
    ],
    window: Windows = None,
    model: KindsNamed = None,
    seeds: Annotated[
        str,
        typer.Option(metavar="N|A:B", help="Seeds of the random numbers: 0 to N-1, or A to B-1."),
    ] = "1",
    out: Annotated[
        Path,
        typer.Option(
            metavar="FOLDER", help="Folder for the results; what it has is not computed again."
        ),
    ] = Path("campaign"),
    workers: Annotated[
        int | None, typer.Option(help="Tasks at a time, on this computer; default all cores.")
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="HOST:PORT", help="Scheduler of dask.distributed; default this computer."
        ),
    ] = None,
    parquet: Annotated[
        bool, typer.Option("--parquet", help=f"Write the table to {PARQUET} too.")
    ] = False,
    *,
    reading: HeldLogOptions,
    parameters: ParameterOptions,
    offset: Annotated[bool, typer.Option(help="Fit a constant sensor offset.")] = True,
    delay: Delay = None,
    drift: Drift = None,
    history: History = None,
    searching: MethodOptions,
    runs: Annotated[
        int | None,
        typer.Option(help="Number of independent searches; default 1, of swarms 4."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Identify models of many logs; run again for the rest."""
    from ..._support.files.writing import save_figures
    from ...identification.campaigns.campaign import campaign
    from ...identification.campaigns.result import check_parquet

    kinds = Kinds.checked(model)
    kinds.refuse_without_effect(context)
    if not any(map(searched, kinds.names)):
        refuse_without_effect(context, ("seeds",), "with models that least squares find")
    result = Output(out, overwrite=True, json=json, quiet=quiet)
    can_be_folder(out)
    if parquet:
        check_parquet()
    options = FitOptions(**vars(parameters), **vars(searching), runs=runs)
    options.check()
    kinds.refuse_of_others(context)
    of_record = {
        "offset": offset,
        "delay": delay_asked(delay),
        "drift": None if drift is None else drift_asked(drift),
        "history": history,
    }
    models = {
        kind: {"model": kind, **of_record, **options.arguments_of(kind)} for kind in kinds.names
    }
    numbers = _seeds(seeds)
    titles, windows = _titles(files), each_of("--window", window, len(files))
    logs = {
        title: windowed(reading.log(file, reading.hold), file, "--window", one)
        for (title, file), one in zip(titles.items(), windows, strict=True)
    }
    with _executor(workers, dask) as executor:
        try:
            results = campaign(
                logs, models, numbers, executor, folder=out, progress=result.progress
            )
        except Interrupted:
            acknowledge_interrupt()
            raise
    written = [out / "campaign.json", *dict.fromkeys(one.file for one in results)]
    written += save_figures({"campaign": results.plot()}, out)
    if parquet:
        written.append(results.to_parquet(out / PARQUET))
    if len(results.failed) == len(results):
        first = results.failed[0]
        raise DataError(f"no model was found of any log; {first.record}: {first.error}")
    result.show(results.summary(), results.document(), _few(written, json=json))


def _titles(files: list[Path]) -> dict[str, Path]:
    """Name logs by their files, with the folders where names alone are not enough."""
    names = [file.name for file in files]
    titles = names if len(set(names)) == len(names) else [str(file) for file in files]
    for i, title in enumerate(titles):
        if title in titles[:i]:
            raise ParameterError(title, "given twice", "it once")
    return dict(zip(titles, files, strict=True))


def _seeds(text: str) -> range:
    """Parse N or A:B."""
    first, colon, last = text.rpartition(":")
    try:
        seeds = range(int(first) if colon else 0, int(last))
    except ValueError:
        seeds = range(0)
    if not seeds or seeds.start < 0:
        raise ParameterError("--seeds", f"'{text}'", "a number, as 10, or A:B, as 10:20")
    return seeds


def _few(written: list[Path], *, json: bool) -> list[Path]:
    """Leave out the names of many results, which say nothing to a person."""
    return written if json else [path for path in written if len(path.stem) < 32]


@contextmanager
def _executor(workers: int | None, dask: str | None) -> Iterator[Executor | None]:
    """Make the executor that the options ask for; None for the usual one."""
    if workers is not None and dask is not None:
        raise ParameterError("--workers and --dask: expected one of them at most, both are given")
    if workers is not None and not 1 <= workers <= 256:
        raise ParameterError("--workers", workers, "1 to 256")
    if dask is not None:
        with _cluster(dask) as client:
            yield client.get_executor()
        return
    if workers is None:
        yield None
        return
    pool = ThreadPoolExecutor(workers)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


@contextmanager
def _cluster(address: str) -> Iterator[Any]:
    """Connect to a scheduler."""
    try:
        import distributed
    except ImportError:
        raise ParameterError(
            "--dask needs dask.distributed: expected it installed, as piezotrack[distributed]"
        ) from None
    # Its types are written in part only.
    connect: Any = distributed.Client
    try:
        client = connect(address, timeout="10s")
    except (OSError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise ParameterError(f"--dask is '{address}': no scheduler answers: {reason}") from None
    try:
        yield client
    finally:
        client.close(timeout=2)
