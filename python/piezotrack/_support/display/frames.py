"""Data frames of pandas, which is not needed for anything else."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["frame_of"]


def frame_of(table: Mapping[str, Any]) -> Any:
    """Make a data frame of columns with their units in the titles.

    Parameters
    ----------
    table : mapping of str to ndarray, shape (n,)
        The columns.

    Returns
    -------
    pandas.DataFrame
        With these columns.

    Raises
    ------
    ParameterError
        pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError:
        raise ParameterError("to_frame needs pandas: expected it installed") from None
    return pd.DataFrame(dict(table))
