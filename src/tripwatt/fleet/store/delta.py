"""Create, open, append to and clean up Delta tables, by many writers at once.

The package `deltalake` is optional and imported on first use.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, TypeVar

import pyarrow as pa
import pyarrow.compute as pc

from tripwatt.errors import InvalidInput, require_extras

Result = TypeVar("Result")

_MAX_TRIES: Final = 200
"""Largest number of tries of one commit; each failure means that another writer succeeded. A choice, because more
writers than this at once are not expected."""

_TARGET_FILE_BYTES: Final = 1 << 40
"""Target size of a data file [bytes], larger than any partition, so that the samples of a log stay in one file."""

_ROW_GROUP_ROWS: Final = 65_536
"""Number of rows in a row group of a data file: some fifty drives at 1 Hz."""


def require_deltalake() -> Any:
    """Import the package `deltalake`.

    Raises
    ------
    InvalidInput
        If the extra is not installed.
    """
    require_extras({"fleet": "a trip store"})
    import deltalake

    return deltalake


def is_url(place: str) -> bool:
    """Return whether a place is the URL of an object store.

    Examples
    --------
    >>> is_url("s3://fleet/store"), is_url("data/store")
    (True, False)
    """
    return "://" in place


def join_place(place: str, name: str) -> str:
    """Return the path or URL of a name inside a place."""
    return f"{place.rstrip('/')}/{name}" if is_url(place) else str(Path(place) / name)


@dataclass(frozen=True)
class DeltaFolder:
    """One Delta table, opened anew for each use but to append, so that every result is of the newest version.

    Attributes
    ----------
    place : str
        A folder or a URL.
    options : mapping of str to str
        Options of the object store, as `deltalake` takes them.
    """

    place: str
    options: Mapping[str, str]

    def create(self, schema: pa.Schema, partition_by: list[str], name: str, about: Mapping[str, Any]) -> None:
        """Create the table if there is none."""
        try:
            with _delta_errors(self.place) as deltalake:
                deltalake.DeltaTable.create(
                    self.place,
                    schema,
                    mode="error",
                    partition_by=partition_by,
                    name=name,
                    description=json.dumps(dict(about)),
                    # bounds of other columns would outlive a vehicle
                    configuration={"delta.dataSkippingStatsColumns": "batch"},
                    storage_options=dict(self.options),
                )
        except InvalidInput:
            if not self.exists():  # another process may have made the table meanwhile
                raise

    def exists(self) -> bool:
        """Return whether there is a Delta table at this place."""
        return bool(require_deltalake().DeltaTable.is_deltatable(self.place, dict(self.options)))

    def open(self) -> Any:
        """Open the newest version.

        Raises
        ------
        InvalidInput
            If there is no table, or it cannot be read.
        """
        with _delta_errors(self.place) as deltalake:
            try:
                return deltalake.DeltaTable(self.place, storage_options=dict(self.options))
            except deltalake.exceptions.TableNotFoundError as error:
                fix = "make one with `tripwatt store create`"
                raise InvalidInput.of("no trip store", self.place, "", "two Delta tables", fix) from error

    def about(self) -> dict[str, Any]:
        """Return the settings that `create` wrote into the table."""
        description = self.open().metadata().description
        try:
            about = json.loads(description or "")
        except json.JSONDecodeError:
            about = None
        if not isinstance(about, dict) or "tripwatt_store" not in about:
            got = "a Delta table of another kind"
            raise InvalidInput.of("no trip store", self.place, got, "a table that tripwatt made")
        return about

    @cached_property
    def _opened(self) -> Any:
        """The table, opened once and kept up to date by what it appends; no commit of others matters for that."""
        return self.open()

    def append(self, rows: pa.Table) -> None:
        """Append rows in one commit; the commit is tried again if another writer was first."""
        self._retry(lambda table: self._write(table, rows, tries=_MAX_TRIES), self._opened)

    def append_checked(self, rows_for: Callable[[Any], pa.Table | None], opened: Any) -> None:
        """Append rows that depend on the rows of the table; the commit succeeds only on the version that was read.

        Parameters
        ----------
        rows_for : callable
            Function from the opened table to the rows to append, or None if there are none. The function is called again if another
            writer was first.
        opened : deltalake.DeltaTable
            The table, opened before. It takes the newest version, since its log is long to read anew.
        """
        with _delta_errors(self.place):
            opened.update_incremental()
        self._retry(lambda table: self._write(table, rows_for(table), tries=0), opened)

    def _write(self, table: Any, rows: pa.Table | None, *, tries: int) -> None:
        """Append rows in one commit, which `deltalake` repeats up to `tries` times."""
        deltalake = require_deltalake()
        if rows is not None:
            deltalake.write_deltalake(
                table,
                rows,
                mode="append",
                target_file_size=_TARGET_FILE_BYTES,
                writer_properties=_writer_properties(),
                commit_properties=deltalake.CommitProperties(max_commit_retries=tries),
            )

    def delete(self, predicate: str) -> int:
        """Delete rows by an SQL predicate; the commit is tried again if another writer was first.

        Returns
        -------
        int
            Number of rows that were deleted.
        """
        metrics = self._retry(lambda table: table.delete(predicate, writer_properties=_writer_properties()))
        return int(metrics.get("num_deleted_rows") or 0)

    def compact(self, target_size: int) -> dict[str, Any]:
        """Merge small data files of each partition up to a size [bytes]; return the numbers of `deltalake` for it."""
        options = {"target_size": target_size, "writer_properties": _writer_properties()}
        metrics: dict[str, Any] = self._retry(lambda table: table.optimize.compact(**options))
        return metrics

    def try_to_compact(self, target_size: int) -> None:
        """Merge small data files, unless another writer commits first."""
        with suppress(require_deltalake().exceptions.DeltaError, OSError):
            self.open().optimize.compact(target_size=target_size, writer_properties=_writer_properties())

    def _retry(self, action: Callable[[Any], Result], opened: Any = None) -> Result:
        """Call an action on the newest version, again while other writers are first, at most `_MAX_TRIES` times."""
        conflict = require_deltalake().exceptions.CommitFailedError
        for _ in range(_MAX_TRIES):
            try:
                with _delta_errors(self.place):
                    return action(opened or self.open())
            except conflict:
                opened = None
        got = f"{_MAX_TRIES} commits of other writers came first"
        allowed = "fewer writers at once, or larger batches"
        raise InvalidInput.of("trip store is busy", self.place, got, allowed)

    def drop_old_files(self, hours: int) -> int:
        """Remove data files that no version of the last `hours` uses; files of writers at work are never removed.

        Returns
        -------
        int
            Number of files that were removed.
        """
        with _delta_errors(self.place):
            removed = self.open().vacuum(
                retention_hours=hours, dry_run=False, enforce_retention_duration=False, full=False
            )
        return len(removed)

    def read(self, columns: list[str], where: Any = None) -> pa.Table:
        """Read rows of the newest version.

        Parameters
        ----------
        columns : list of str
        where : pyarrow.dataset.Expression, optional
        """
        return self.open().to_pyarrow_dataset().to_table(columns=columns, filter=where)

    def data_files(self) -> list[dict[str, Any]]:
        """Return the data files of the newest version, sorted by path.

        Returns
        -------
        list of dict
            One for each file, as `deltalake` names its values: `path` relative to the table, `size_bytes`, `partition.` and a column by
            which the table is partitioned, and `min.batch` and `max.batch`, the first and last name of the batches in the file.
        """
        actions = pa.table(self.open().get_add_actions(flatten=True)).to_pylist()
        return sorted(actions, key=lambda action: str(action["path"]))

    def filesystem(self) -> Any:
        """Return the table's folder as a file system of pyarrow."""
        from pyarrow import fs

        if not is_url(self.place):
            return fs.SubTreeFileSystem(str(Path(self.place).absolute()), fs.LocalFileSystem())
        from deltalake.fs import DeltaStorageHandler

        return fs.PyFileSystem(DeltaStorageHandler(self.place, dict(self.options)))


def text_column(name: str) -> Any:
    """Return a column of texts for a condition on rows.

    The cast is needed because files that a deletion wrote again hold views of texts, which pyarrow compares with no other texts.
    """
    return pc.field(name).cast(pa.large_string())


def is_one_of(name: str, texts: Iterable[str]) -> Any:
    """Return the condition that a column has one of some texts."""
    return text_column(name).isin(pa.array([*texts], pa.large_string()))


def _writer_properties() -> Any:
    """Return the settings with which data files are written; they keep merged files no larger than their parts."""
    return require_deltalake().WriterProperties(compression="ZSTD", max_row_group_size=_ROW_GROUP_ROWS)


@contextmanager
def _delta_errors(place: str) -> Iterator[Any]:
    """Yield the package `deltalake`, and raise `InvalidInput` if the table cannot be used, such as on a full disk.

    `CommitFailedError` is passed on: it means that another writer was first, so the caller tries again.
    """
    deltalake = require_deltalake()
    try:
        yield deltalake
    except deltalake.exceptions.CommitFailedError:
        raise
    except (deltalake.exceptions.DeltaError, OSError) as error:
        got = (str(error).splitlines() or [type(error).__name__])[0][:200]
        allowed = "a folder or an object store that can be read and written"
        raise InvalidInput.of("trip store cannot be used", place, got, allowed) from error
