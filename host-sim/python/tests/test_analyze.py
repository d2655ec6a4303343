"""The same recording as a file, as bytes, in arrays and in tables of other programs; the report; and what is refused."""

from __future__ import annotations

import json
import math
import os
import pickle
import threading
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import imunoise
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

from recording import ACCELEROMETER, GYRO, NAMES, RATE, UNITS, as_bag, as_csv, columns

TABLE = columns()


def analyzed(source: Any, **options: Any) -> imunoise.Report:
    return imunoise.analyze(source, units=UNITS, **options)


def content(report: imunoise.Report) -> dict[str, Any]:
    """The report without what was read for it."""
    read: dict[str, Any] = json.loads(report.to_json())
    del read["reading"]
    return read


@pytest.fixture(scope="module")
def report() -> imunoise.Report:
    return analyzed(TABLE)


def test_n_of_every_channel_is_that_of_the_noise(report: imunoise.Report) -> None:
    for name in NAMES[1:]:
        found = report[name].coefficients["angle_random_walk"]
        # deg/√s and g/√Hz; four standard errors of the estimate are two half widths of its interval.
        size = math.degrees(GYRO) if name.startswith("gyro") else ACCELEROMETER / 9.80665
        assert abs(found.value - size / math.sqrt(RATE)) < found.high - found.low, name
    assert (report.samples, report.complete, report.damage) == (len(TABLE["time"]), True, None)
    assert report.rate_hz == pytest.approx(RATE, rel=1e-9)


def records() -> np.ndarray:
    """The columns as fields of one array."""
    array = np.empty(len(TABLE["time"]), dtype=[(name, column.dtype) for name, column in TABLE.items()])
    for name, column in TABLE.items():
        array[name] = column
    return array


def pieces() -> pa.Table:
    """A table of three batches, one of them empty."""
    whole = pa.table(TABLE)
    parts = [whole.slice(0, 7_001), whole.slice(7_001, 0), whole.slice(7_001)]
    return pa.concat_tables(parts)


@pytest.mark.parametrize(
    "source",
    [
        lambda path: path.write_bytes(as_csv(TABLE)) and path,
        lambda path: as_csv(TABLE),
        lambda path: memoryview(as_csv(TABLE)),
        lambda path: records(),
        lambda path: {"time": TABLE["time"].astype("datetime64[ns]")} | {name: TABLE[name] for name in NAMES[1:]},
        lambda path: {name: np.repeat(column, 3)[::3] for name, column in TABLE.items()},
        lambda path: {name: column.astype(column.dtype.newbyteorder(">")) for name, column in TABLE.items()},
        lambda path: pd.DataFrame(TABLE),
        lambda path: pl.DataFrame(TABLE),
        lambda path: pieces(),
        lambda path: pieces().to_reader(),
        lambda path: pa.table(TABLE).append_column("label", pa.array(["still"] * len(TABLE["time"]))),
    ],
    ids=["file", "bytes", "memory", "records", "datetime", "strided", "big-endian", "pandas", "polars", "arrow", "reader", "text"],
)
def test_every_source_has_the_same_report(source: Any, report: imunoise.Report, tmp_path: Path) -> None:
    assert content(analyzed(source(tmp_path / "imu.csv"))) == content(report)


def test_a_column_without_numbers_is_named(report: imunoise.Report) -> None:
    labelled = pa.table(TABLE).append_column("label", pa.array(["still"] * len(TABLE["time"])))
    assert any("label" in note for note in analyzed(labelled).notes)
    assert not any("label" in note for note in report.notes)


def test_matrices_have_their_columns_by_number(report: imunoise.Report) -> None:
    gyro, accl = (np.stack([TABLE[f"{name}_{axis}"] for axis in "xyz"], axis=1) for name in ("gyro", "accl"))
    chosen = {f"{name}_{axis}": f"{name}.{at}" for name in ("gyro", "accl") for at, axis in enumerate("xyz")}
    arrays = {"time": TABLE["time"], "gyro": gyro, "accl": np.asfortranarray(accl)}
    assert content(analyzed(arrays, columns=chosen | {"time": "time"})) == content(report)
    alone = imunoise.analyze(gyro, rate=RATE, columns={"gyro_x": "0", "gyro_y": "1", "gyro_z": "2"}, units="rad/s")
    assert alone["gyro_z"].adev == pytest.approx(report["gyro_z"].adev, rel=1e-9)


def test_masked_numbers_and_nulls_are_missing() -> None:
    rows = [100, 5_000, 5_001]
    with_nan = {name: column.copy() for name, column in TABLE.items()}
    with_nan["gyro_z"][rows] = np.nan
    mask = np.zeros(len(TABLE["time"]), dtype=bool)
    mask[rows] = True
    masked = TABLE | {"gyro_z": np.ma.MaskedArray(TABLE["gyro_z"], mask)}
    nulls = pa.table(TABLE | {"gyro_z": pa.array(TABLE["gyro_z"], mask=mask)})
    expected = content(analyzed(with_nan))
    assert expected["channels"][2]["refused"] == {"missing": len(rows)}
    assert content(analyzed(masked)) == expected
    assert content(analyzed(nulls)) == expected


def test_integers_are_read_with_their_units() -> None:
    counts = {name: np.rint(TABLE[name] * 1e5).astype(np.int32) for name in NAMES[1:]}
    reals = {name: column.astype(np.float64) for name, column in counts.items()}
    reports = [content(analyzed(arrays | {"time": TABLE["time"]})) for arrays in (counts, reals)]
    assert reports[0] == reports[1]


def test_threads_do_not_change_the_report(report: imunoise.Report) -> None:
    assert content(analyzed(TABLE, threads=2)) == content(report)


def test_the_attributes_are_those_of_the_report(report: imunoise.Report, tmp_path: Path) -> None:
    channel = report["gyro_y"]
    assert (channel.unit, channel.samples, len(channel.tau)) == ("deg/s", report.samples, len(channel.model))
    assert channel.low[0] < channel.adev[0] < channel.high[0]
    assert channel.tau[3] == pytest.approx(channel.n[3] / RATE, rel=1e-9)
    assert list(report.channels) == NAMES[1:]
    assert "gyro_y" in report.figure("gyro_y") or "gyro y" in report.figure("gyro_y")
    assert ElementTree.fromstring(report.figure("gyro_y")).tag.endswith("svg")
    with pytest.raises(KeyError, match="no channel gyro but gyro_x"):
        report.figure("gyro")
    report.save(tmp_path / "page.html")
    assert "<h1>" in (tmp_path / "page.html").read_text(encoding="utf-8")
    assert report._repr_html_().startswith("<iframe srcdoc=")
    assert len(report._repr_html_()) < (tmp_path / "page.html").stat().st_size
    assert "gyro" in str(report)
    assert "6 channels" in repr(report)
    assert report.export(kalibr=tmp_path / "imu.yaml") == []
    assert "gyroscope_noise_density" in (tmp_path / "imu.yaml").read_text(encoding="utf-8")
    with pytest.raises(ValueError, match="none of kalibr"):
        report.export(kalibrr=tmp_path / "none")


def test_rows_are_one_flat_table(report: imunoise.Report) -> None:
    rows = report.rows()
    table = pa.table(rows)
    assert table.num_rows == len(rows)
    assert table.schema == pa.schema(rows)
    assert pl.DataFrame(rows).height == len(rows)
    assert table.to_pylist() == list(rows)
    kinds = table.column("row").to_pylist()
    assert kinds[0] == "recording" and kinds.count("recording") == 1
    coefficients = [row for row in rows if row["row"] == "coefficient"]
    walks = {row["channel"]: row["value"] for row in coefficients if row["kind"] == "angle_random_walk"}
    assert walks == {name: report[name].coefficients["angle_random_walk"].value for name in NAMES[1:]}
    copied = pickle.loads(pickle.dumps(rows))
    assert list(copied) == list(rows)


def test_a_file_that_fails_is_a_row(tmp_path: Path) -> None:
    good, empty = tmp_path / "good.csv", tmp_path / "empty.csv"
    good.write_bytes(as_csv(columns(2_000)))
    empty.write_bytes(b"")
    rows = list(imunoise.rows([good, empty, tmp_path / "absent.csv"], units=UNITS))
    status = {Path(row["recording"]).name: row["status"] for row in rows if row["row"] == "recording"}
    assert status == {"good.csv": "complete", "empty.csv": "failed", "absent.csv": "failed"}
    [reason] = [row["reason"] for row in rows if row["recording"] == str(empty)]
    assert "empty" in reason


def test_a_recording_that_ends_early_is_not_complete() -> None:
    whole = as_bag(columns(4_000))
    assert imunoise.analyze(whole).complete
    cut = imunoise.analyze(whole[: len(whole) * 3 // 4])
    assert not cut.complete
    assert cut.damage
    assert list(cut.rows())[0]["status"] == "incomplete"


@pytest.mark.parametrize(
    ("source", "options", "error", "message"),
    [
        ("absent.csv", {}, FileNotFoundError, "absent.csv"),
        (b"", {}, imunoise.RecordingError, "empty"),
        ({"a": np.zeros(5)}, {}, imunoise.RecordingError, "gyro"),
        ({"time": np.arange(5), "gyro_x": np.zeros(4)}, {"units": ["rad/s"]}, imunoise.RecordingError, "4 rows"),
        (TABLE, {"units": ["furlong"]}, imunoise.RecordingError, "furlong"),
        (TABLE, {"threads": 0}, ValueError, "threads is 0"),
        (TABLE, {"sensor": "adis1640"}, imunoise.RecordingError, "similar sensor"),
        (5, {}, TypeError, "int is no path"),
        ({"gyro_x": np.zeros((2, 2, 2))}, {}, ValueError, "shape"),
        ({"gyro_x": np.array(["a"])}, {}, TypeError, "must hold numbers"),
    ],
)
def test_what_is_refused_is_said(source: Any, options: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        imunoise.analyze(source, **options)


def test_an_error_has_the_columns_and_the_units_that_are_missing() -> None:
    with pytest.raises(imunoise.RecordingError) as raised:
        imunoise.analyze({name: TABLE[name] for name in NAMES})
    assert "gyro_x" in str(raised.value) and "--units" in str(raised.value)


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="the system does not tell its threads")
def test_no_thread_is_begun_that_was_not_asked_for() -> None:
    most, stop = 0, threading.Event()

    def watch() -> None:
        nonlocal most
        while not stop.is_set():
            most = max(most, len(os.listdir("/proc/self/task")))

    watcher = threading.Thread(target=watch)
    watcher.start()
    before = len(os.listdir("/proc/self/task"))
    analyzed(TABLE)
    analyzed(as_csv(columns(2_000)))
    stop.set()
    watcher.join()
    assert most == before
