"""``piezotrack campaign``: many logs, models and seeds, with a file for each result."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from ...errors import DataError, Interrupted, ParameterError
from ..command import Argument, Option, command, refuse_without_effect
from ..option_groups import LogOptions
from ..options import WINDOW, Threads, cut
from ..output import OUT, Printing, can_be_folder
from ..process.interruption import acknowledge_interrupt
from ..values import TIME, parted
from .fit_options import (
    FitOptions,
    Kinds,
    MethodOptions,
    Models,
    ParameterOptions,
    RecordOptions,
    Runs,
    searched,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from concurrent.futures import Executor

    from ...data.dataset import Dataset

__all__ = ["campaign_command"]

PARQUET = "campaign.parquet"


@command()
def campaign_command(
    files: Annotated[list[Path], Argument("Logs: CSV, MAT, HDF5, TDMS, NPZ and others", "FILE")],
    window: Annotated[
        list[tuple[float | None, float | None]] | None,
        Option("Part of each log, as 3s:15s; repeated: several records of each log", WINDOW),
    ] = None,
    every: Annotated[
        float | None, Option("Cut each log or window into records of this length", TIME)
    ] = None,
    model: Models = None,
    seeds: Annotated[
        str, Option("Seeds of the random numbers: 0 to N-1, or A to B-1", metavar="N|A:B")
    ] = "1",
    threads: Threads = None,
    dask: Annotated[
        str | None,
        Option("Scheduler of dask.distributed; default this computer", metavar="HOST:PORT"),
    ] = None,
    parquet: Annotated[bool, Option(f"Write the table to {PARQUET} as well")] = False,
    *,
    reading: LogOptions,
    sensor: RecordOptions,
    structure: MethodOptions,
    runs: Runs = None,
    parameters: ParameterOptions,
    out: Annotated[
        Path,
        Option(
            "Folder for the results; those that it has are not computed again",
            metavar="PATH",
            names=OUT,
        ),
    ] = Path("campaign"),
    printing: Printing,
) -> None:
    """Identify models of many logs or windows; a second call continues."""
    from ..._support.files.writing import save_figures
    from ...identification.campaigns.campaign import campaign
    from ...identification.campaigns.result import check_parquet

    kinds = Kinds.checked(model)
    kinds.refuse_without_effect()
    if not any(map(searched, kinds.names)):
        refuse_without_effect(("seeds",), "with models that are fitted by least squares")
    can_be_folder(out)
    if parquet:
        check_parquet()
    options = FitOptions(**vars(parameters), **vars(structure), runs=runs)
    options.check()
    kinds.refuse_of_others(options.parameters())
    sensor.check(1)
    (of_record,) = sensor.of_each(1)
    models = {
        kind: {"model": kind, **of_record, **options.arguments_of(kind)} for kind in kinds.names
    }
    numbers = _seeds(seeds)
    logs: dict[str, Dataset] = {}
    for title, file in _titles(files).items():
        whole = reading.log(file)
        for one in window or (None,):
            logs |= _pieces(title, cut(whole, file, one), one, every)
    with _executor(threads, dask) as executor:
        try:
            results = campaign(
                logs, models, numbers, executor, folder=out, progress=printing.progress
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
    printing.show(results.summary(), results.document(), _few(written, json=printing.json))


def _pieces(
    title: str, log: Dataset, window: tuple[float | None, float | None] | None, every: float | None
) -> dict[str, Dataset]:
    """Name a log by its file and window, or cut it into windows of one length."""
    begin, end = float(log.t[0]), float(log.t[-1])
    if every is None:
        return {title if window is None else f"{title} {begin:.6g} to {end:.6g} s": log}
    if not 2.0 * log.dt < every <= end - begin + log.dt:
        raise ParameterError(
            "--every",
            f"{every:g} s",
            f"more than 2 samples of {title}, {2.0 * log.dt:.6g} s, and at most its length, "
            f"{end - begin:.6g} s",
        )
    count = int((end - begin + 1.5 * log.dt) / every)
    starts = [begin + k * every for k in range(count)]
    # Up to the sample before the next window.
    return {
        f"{title} {start:.6g} to {start + every:.6g} s": log[start : start + every - 0.5 * log.dt]
        for start in starts
    }


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
    first, mark, last = parted(text)
    try:
        seeds = range(int(first), int(last)) if mark else range(int(text))
    except ValueError:
        seeds = range(0)
    if not seeds or seeds.start < 0:
        raise ParameterError("--seeds", f"'{text}'", "a number, as 10, or A:B, as 10:20")
    return seeds


def _few(written: list[Path], *, json: bool) -> list[Path]:
    """Leave out the names of many results, which say nothing to a person."""
    return written if json else [path for path in written if len(path.stem) < 32]


@contextmanager
def _executor(threads: int | None, dask: str | None) -> Iterator[Executor | None]:
    """Make the executor that the options ask for; None for the usual one."""
    if threads is not None and dask is not None:
        raise ParameterError("--threads and --dask: expected one of them at most, both are given")
    if threads is not None and not 1 <= threads <= 256:
        raise ParameterError("--threads", threads, "1 to 256")
    if dask is not None:
        with _cluster(dask) as client:
            yield client.get_executor()
        return
    if threads is None:
        yield None
        return
    pool = ThreadPoolExecutor(threads)
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
