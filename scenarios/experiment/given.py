"""An experiment as it is given: a file, its folder, a table in Python, or an object; with data or without."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from fmus.errors import BadInput
from scenarios.experiment.declaration import Declaration
from scenarios.experiment.experiment import Experiment, load_experiment, placed
from scenarios.experiment.validation import of_file, read_table

Given = str | Path | Mapping[str, Any] | Experiment
IN_PYTHON = "experiment"  # stands for the file in messages
FRAME = "data.parquet"


def given(
    experiment: Given, data_dir: str | Path | None, data: pd.DataFrame | None, work: Path
) -> Experiment:
    """The experiment, read and checked; paths in a table are relative to the current folder.

    data: the record, in place of the experiment's data file; units by column in data.attrs["units"], and the
    time as a column or as the index. work: a folder that lives as long as the experiment is used.
    Raises BadInput if the experiment is wrong.
    """
    if isinstance(experiment, Experiment):
        found = experiment
    elif isinstance(experiment, Mapping):
        table = dict(experiment) if data is None else {**experiment, "data": FRAME}
        file = Path(IN_PYTHON)
        with of_file(file):
            found = placed(read_table(Declaration, table), file, data_dir)
    else:
        where = Path(experiment)
        found = load_experiment(where / "experiment.toml" if where.is_dir() else where, data_dir)
    return found if data is None else _with_frame(found, data, work)


def _with_frame(e: Experiment, data: pd.DataFrame, work: Path) -> Experiment:
    """The experiment with a table as its record, written to a file as all other data are."""
    if e.split and e.split.files:
        raise BadInput(f"{e.file}: [split] names files, but the data are one table; give windows in seconds")
    table = data if e.time in data.columns else data.reset_index()
    if e.time not in table.columns:
        raise BadInput(
            f"{e.file}: key 'time': column '{e.time}' is neither a column nor the index of the data"
        )
    import pyarrow as pa
    import pyarrow.parquet as pq

    units = data.attrs.get("units", {})
    arrow = pa.Table.from_pandas(table, preserve_index=False)
    fields = [f.with_metadata({"unit": units[f.name]}) if units.get(f.name) else f for f in arrow.schema]
    pq.write_table(arrow.cast(pa.schema(fields)), work / FRAME)
    return placed(e.model_copy(update={"data": FRAME}), e.file, work)
