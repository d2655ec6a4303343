"""The code of docs/fleet.md: a fleet with known differences, mapped by each engine; and its questions."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from recording import GYRO, RATE, as_csv, columns

PAGE = (Path(__file__).parents[3] / "docs" / "fleet.md").read_text(encoding="utf-8")
# Rows of a part: long enough for the drift of the part that drifts, not for that of the others.
ROWS = 40_000
# The part that drifts, the one that vibrates at a frequency in Hz, the one that is twice as noisy, and a file that is none.
DRIFTS, VIBRATES, NOISY, BROKEN = "c", "d", "e", "f"
VIBRATION_HZ = 20.3


def block(heading: str) -> str:
    """The Python of a section of the page."""
    found = re.search(rf"^## {heading}\n(?:(?!^## ).)*?^```python\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    assert found, heading
    return found[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the recordings of six parts."""
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "parts").mkdir()
    for seed, part in enumerate("abcde"):
        table = columns(ROWS, seed)
        time = np.arange(ROWS) / RATE
        if part == DRIFTS:
            steps = np.random.default_rng(100).normal(0.0, GYRO / 20, ROWS)
            table["gyro_y"] += np.cumsum(steps)
        if part == VIBRATES:
            table["gyro_x"] += GYRO * np.sin(2 * np.pi * VIBRATION_HZ * time)
        if part == NOISY:
            for axis in "xyz":
                table[f"gyro_{axis}"] *= 2
        (folder / "parts" / f"{part}.csv").write_bytes(as_csv(table))
    (folder / "parts" / f"{BROKEN}.csv").write_bytes(b"no numbers\nhere\n")
    return folder


def mapped(heading: str, folder: Path) -> pa.Table:
    """The table that the code of a section makes, in a process of its own."""
    file = folder / f"{heading}.parquet"
    code = f"{block(heading)}\nimport pyarrow.parquet\npyarrow.parquet.write_table(fleet, {str(file)!r})\n"
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return pq.read_table(file)


def sorted_rows(table: pa.Table) -> list[str]:
    return sorted(str(row) for row in table.to_pylist())


@pytest.fixture(scope="module")
def fleet(folder: Path) -> pa.Table:
    return mapped("A pool of threads", folder)


def test_the_questions_find_what_was_put_in(fleet: pa.Table) -> None:
    connection = duckdb.connect()
    connection.register("fleet", fleet)
    statements = re.findall(r"```sql\n(.*?)```", PAGE, re.DOTALL)
    drift, lines, noisy = (connection.execute(statement).fetchall() for statement in statements)
    assert (Path(drift[0][0]).stem, drift[0][1]) == (DRIFTS, "gyro_y")
    vibrating = [row for row in lines if Path(row[0]).stem == VIBRATES]
    assert vibrating[0][1] == "gyro_x"
    # A line of this size is located to a fraction of the record's resolution of 1/200 Hz.
    assert abs(vibrating[0][3] - VIBRATION_HZ) < RATE / ROWS
    noisy_gyros = {row[1] for row in noisy if Path(row[0]).stem == NOISY}
    assert noisy_gyros == {"gyro_x", "gyro_y", "gyro_z"}
    assert {Path(row[0]).stem for row in noisy if row[1].startswith("gyro")} == {NOISY}
    recordings = [row for row in fleet.to_pylist() if row["row"] == "recording"]
    assert [Path(row["recording"]).stem for row in recordings if row["status"] != "complete"] == [BROKEN]


def test_dask_maps_it(fleet: pa.Table, folder: Path) -> None:
    assert sorted_rows(mapped("Dask", folder)) == sorted_rows(fleet)


@pytest.mark.cluster
@pytest.mark.parametrize("engine", ["Ray", "Spark"])
def test_a_cluster_maps_it(engine: str, fleet: pa.Table, folder: Path) -> None:
    assert sorted_rows(mapped(engine, folder)) == sorted_rows(fleet)


@pytest.mark.cluster
def test_shards_are_one_pass_with_gaps_to_the_last_bit(tmp_path: Path) -> None:
    code = block("One recording that is too long for one machine")
    check = """
ray.shutdown()
once = imunoise.Cascade()
for shard in range(SHARDS):
    once.gap(GAP if shard else 0)
    once.push(counts(shard))
assert len(whole) == len(once) == SHARDS * LENGTH > 10**9
expected = once.curve(rate=200.0, lsb=0.05)
for name in ("n", "tau", "adev", "low", "high", "edf", "count", "kurtosis", "replaced"):
    assert getattr(curve, name).tobytes() == getattr(expected, name).tobytes(), name
assert str(model) == str(imunoise.fit(expected, ["angle_random_walk", "bias_instability", "rate_random_walk"]))
"""
    done = subprocess.run([sys.executable, "-c", code + check], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
