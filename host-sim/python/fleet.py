"""Processor time a recording of the ways to analyse a fleet (docs/fleet.md), on simulated minutes of twelve channels.

    python fleet.py COMMAND FOLDER [RECORDINGS [COMPARED]]    # COMMAND, such as target/release/imunoise

The command analyses all RECORDINGS (a thousand by default) once, with two at a time. On COMPARED of them (120) all ways run in turn,
twenty recordings at a time. FOLDER keeps the recordings.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import dask.bag
import imunoise
import pyarrow as pa

AT_A_TIME = 20
Way = Callable[[list[str], int], int]


def processor_seconds() -> float:
    """Of this process and of those that it waited for."""
    usages = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def recordings(command: str, folder: Path, count: int) -> list[str]:
    """Simulates those that the folder does not have."""
    folder.mkdir(exist_ok=True)
    files = [folder / f"minute-{seed:04}.csv" for seed in range(1, count + 1)]
    for seed, file in enumerate(files, 1):
        if not file.exists():
            words = [command, "simulate", str(file), "--seconds", "60", "--seed", str(seed)]
            subprocess.run(words, check=True, capture_output=True)
    return [str(file) for file in files]


def of_file(path: str) -> pa.Table:
    return pa.table(imunoise.rows([path]))


def pool(files: list[str], workers: int) -> int:
    with ThreadPoolExecutor(workers) as threads:
        return pa.concat_tables(threads.map(of_file, files)).num_rows


def by_dask(files: list[str], workers: int) -> int:
    parts = dask.bag.from_sequence(files, npartitions=workers).map_partitions(lambda paths: [pa.table(imunoise.rows(paths))])
    return pa.concat_tables(parts.compute(scheduler="processes", num_workers=workers)).num_rows


def batch(command: str) -> Way:
    """The command, with a report and a row a recording; returns the number of its rows."""

    def of(files: list[str], workers: int) -> int:
        with tempfile.TemporaryDirectory() as folder:
            rows = Path(folder) / "rows.ndjson"
            words = [command, "batch", "-j", str(workers), "-q", "-o", f"{folder}/reports", "--rows", str(rows), *files]
            subprocess.run(words, check=True, capture_output=True)
            lines = [json.loads(line) for line in rows.read_text(encoding="utf-8").splitlines()]
        statuses.update(line["status"] for line in lines if line["row"] == "recording")
        return len(lines)

    return of


statuses: Counter[str] = Counter()


def main() -> None:
    command, folder = sys.argv[1], Path(sys.argv[2])
    count, compared = map(int, [*sys.argv[3:], *("1000", "120")[len(sys.argv) - 3 :]])
    files = recordings(command, folder, max(count, compared))
    ways: dict[str, Way] = {"batch -j": batch(command), "pool of threads": pool, "Dask, processes": by_dask}
    used: defaultdict[tuple[str, int], float] = defaultdict(float)
    for first in range(0, compared, AT_A_TIME):
        for name, way in ways.items():
            for workers in (1, 2):
                before = processor_seconds()
                way(files[first : first + AT_A_TIME], workers)
                used[name, workers] += processor_seconds() - before
    print(f"{'':24} processor time a recording, recordings an hour of processors of their own")
    for (name, workers), seconds in used.items():
        each = seconds / compared
        print(f"{name:20} {workers:3} {1e3 * each:8.0f} ms {3600 * workers / each:10.0f} {seconds / used['batch -j', workers] - 1:+8.1%}")

    statuses.clear()
    before, start = processor_seconds(), time.monotonic()
    rows = ways["batch -j"](files[:count], 2)
    seconds, wall = processor_seconds() - before, time.monotonic() - start
    print(f"{count} recordings: {seconds:.0f} s of processor, {wall:.0f} s, {rows} rows, {dict(statuses)}")


if __name__ == "__main__":
    main()
