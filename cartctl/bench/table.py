"""Results as Parquet: one row a run, streamed, the schema's version in the file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from cartctl.bench.journal import NAME, current
from cartctl.bench.schema import VERSION, arrow
from cartctl.errors import ParameterError, ResultFileError
from cartctl.files import whole_file

FILE = "results.parquet"
_BATCH = 500
Row = dict[str, Any]


def write(rows: Iterable[Row], path: Path) -> Path:
    """Write rows, some hundred in memory at a time; the file appears whole or not at all."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema, stream = arrow(), iter(rows)
    with whole_file(path) as part, pq.ParquetWriter(part, schema, compression="zstd") as writer:
        while batch := list(islice(stream, _BATCH)):
            writer.write_table(pa.Table.from_pylist(batch, schema=schema))
    return path


def rows_of(path: Path) -> Iterator[Row]:
    """Rows of a Parquet file, one batch in memory at a time; raises ResultFileError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(path)
        version = (file.schema_arrow.metadata or {}).get(b"cartctl.bench.schema", b"").decode()
    except FileNotFoundError:
        raise ResultFileError(f"{path}: no such file; expected {FILE} of a bench") from None
    except (pa.ArrowInvalid, OSError) as error:
        raise ResultFileError(f"{path} cannot be read as Parquet ({error}); expected {FILE} of a bench") from None
    if version != str(VERSION):
        raise ResultFileError(
            f"{path} has schema version {version or 'none'!s}; expected {VERSION}, as this version writes"
        )
    with file:
        for batch in file.iter_batches(batch_size=_BATCH):
            yield from batch.to_pylist()


def results(place: str | Path) -> list[Row]:
    """All runs of a folder (its journal is the truth) or of a Parquet file; raises ResultFileError, ParameterError."""
    if not isinstance(place, (str, Path)):
        raise ParameterError(f"place is a {type(place).__name__}; expected the folder of a bench, or its {FILE}")
    place = Path(place)
    if place.is_dir():
        if not (place / NAME).is_file() and not (place / FILE).is_file():
            raise ResultFileError(f"{place} holds no bench; expected {NAME} or {FILE}, as `cartctl bench run` writes")
        rows = list(current(place)) if (place / NAME).is_file() else list(rows_of(place / FILE))
    else:
        rows = list(rows_of(place))
    if not rows:
        raise ResultFileError(f"{place} holds no finished run; run `cartctl bench run` to its end")
    return rows
