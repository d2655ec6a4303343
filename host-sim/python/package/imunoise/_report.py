"""The report of an analysis."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from . import _native
from ._curve import Floats, Integers, _read_only



@dataclass(frozen=True)
class Estimate:
    """An estimate with its 95 % bounds; `low` is 0 where the record gives an upper limit alone, `high` is infinite without one."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Finding:
    """What the baseline model of a sensor lacks.

    Attributes:
        kind: such as `sinusoid`.
        channels: those that show it.
        parameters: by channel and name, such as `parameters["gyro_z"]["frequency"]`.
        evidence: what it rests on, as the JSON of a report has it.
        validated: `yes`, `no` or `untestable` on the second half of the record.
    """

    kind: str
    channels: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, Estimate]]
    evidence: Any
    validated: str


@dataclass(frozen=True)
class Channel:
    """One output of a sensor.

    Attributes:
        name: such as `gyro_z`.
        unit: of the deviations, such as `deg/s`.
        samples: number of samples taken.
        coefficients: by kind, such as `coefficients["angle_random_walk"]`.
        n, tau, adev, low, high, edf: the measured Allan deviation by averaging time, as in `Curve`.
        model: deviation of the final model at each `tau`.
        error_before, error_after: deviance a point on the second half of the record, of the baseline model and of the model with
            what was found, both fitted to the first half; 1 for a true model, None where the record is too short.
    """

    name: str
    unit: str
    samples: int
    coefficients: Mapping[str, Estimate]
    n: Integers
    tau: Floats
    adev: Floats
    low: Floats
    high: Floats
    edf: Floats
    model: Floats
    error_before: float | None
    error_after: float | None


class Svg(str):
    """A figure as an SVG document, which a notebook shows."""

    __slots__ = ()

    def _repr_svg_(self) -> str:
        return str(self)


class Rows:
    """Rows of reports, a flat table: one row a recording, one a coefficient, one a parameter of a finding.

    Any program that reads Arrow's C data interface takes it: `pyarrow.table(rows)`, `polars.DataFrame(rows)`,
    `duckdb.from_arrow(pyarrow.table(rows))`. `docs/fleet.md` of the repository describes the columns.
    """

    __slots__ = ("_native",)

    def __init__(self, native: _native.Rows) -> None:
        self._native = native

    def __len__(self) -> int:
        return len(self._native)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Each row by the names of the columns."""
        for line in self.to_ndjson().splitlines():
            yield json.loads(line)

    def to_ndjson(self) -> str:
        """The rows as one JSON object a line."""
        return self._native.json_lines()

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self._native.__arrow_c_stream__(requested_schema)

    def __arrow_c_schema__(self) -> object:
        return self._native.__arrow_c_schema__()

    def __repr__(self) -> str:
        return f"<Rows: {len(self)}>"

    def __getstate__(self) -> bytes:
        return self._native.state()

    def __setstate__(self, state: bytes) -> None:
        self._native = _native.Rows.from_state(state)


class Report:
    """What `analyze` found in a recording.

    Attributes are read from the report when they are asked for. `print` shows it in sentences, a notebook its first screen.
    """

    def __init__(self, native: _native.Report) -> None:
        self._native = native

    @cached_property
    def _json(self) -> dict[str, Any]:
        report: dict[str, Any] = json.loads(self._native.json())
        return report

    @property
    def name(self) -> str:
        """How the recording is called."""
        return self._native.name()

    @property
    def sensor(self) -> str:
        """Name of the sensor's profile."""
        return str(self._json["part"]["name"])

    @property
    def rate_hz(self) -> float:
        """Sample rate, Hz."""
        return float(self._json["sample_rate_hz"])

    @property
    def samples(self) -> int:
        """Samples that were used."""
        return int(self._json["samples"])

    @property
    def hours(self) -> float:
        """Length of the record by its samples."""
        return self.samples / self.rate_hz / 3600.0

    @property
    def complete(self) -> bool:
        """Whether the recording was read to its end."""
        return bool(self._json.get("reading", {}).get("complete", True))

    @property
    def damage(self) -> str | None:
        """Why it was not, where the recording is damaged."""
        damage = self._json.get("reading", {}).get("damage")
        return None if damage is None else str(damage)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader should know of the recording, one sentence each."""
        return tuple(self._json.get("reading", {}).get("notes", ()))

    @property
    def sha256(self) -> str | None:
        """Of the bytes of a file, in hexadecimal digits."""
        sha256 = self._json.get("reading", {}).get("sha256")
        return None if sha256 is None else str(sha256)

    @property
    def dropped(self) -> Mapping[str, int]:
        """Samples that are missing or were refused, by cause."""
        return dict(self._json["dropped"])

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """What the baseline models lack."""
        return tuple(_finding(finding) for finding in self._json["findings"])

    @cached_property
    def channels(self) -> Mapping[str, Channel]:
        """The channels by name."""
        rows = [row for row in self.rows() if row["row"] == "coefficient"]
        return {channel["name"]: _channel(channel, rows) for channel in self._json["channels"]}

    def __getitem__(self, channel: str) -> Channel:
        """A channel by its name."""
        return self.channels[channel]

    def to_json(self) -> str:
        """The report as JSON, as `imunoise analyze -o report.json` writes it; `docs/json-schema.md` of the repository describes it."""
        return self._native.json()

    def rows(self) -> Rows:
        """The report as rows of a flat table."""
        return Rows(self._native.rows())

    def figure(self, channel: str) -> Svg:
        """The Allan deviation of a channel with its bounds, its model and the terms of that."""
        return Svg(self._native.figure(channel))

    def save(self, page: str | os.PathLike[str]) -> None:
        """Writes the report as one HTML file that needs no other."""
        Path(page).write_text(self._native.page(True), encoding="utf-8")

    def export(self, *, axis: str = "rms", **files: str | os.PathLike[str]) -> list[str]:
        """Writes the noise in the format of other programs, as in `export(kalibr="imu.yaml")`.

        Args:
            axis: the number for three axes: `rms`, their root mean square, or `worst`.
            files: the file of each format: kalibr, openvins, vins, orbslam3, matlab, kf_gins, gtsam, basalt, gazebo, csv.

        Returns:
            What a format wants and the report does not have.
        """
        missing: list[str] = []
        for format_name, file in files.items():
            text, lacking = self._native.export(format_name.replace("_", "-"), axis)
            Path(file).write_text(text, encoding="utf-8")
            missing += [f"{file}: no {field}" for field in lacking]
        return missing

    def __str__(self) -> str:
        return self._native.text()

    def __repr__(self) -> str:
        end = "" if self.complete else ", incomplete"
        return f"<Report on {self.name}: {len(self.channels)} channels, {self.hours:.3g} h, {len(self.findings)} findings{end}>"

    def _repr_html_(self) -> str:
        # A document of its own, so that neither its style nor that of the notebook reaches the other.
        page = html.escape(self._native.page(False), quote=True)
        return f'<iframe srcdoc="{page}" title="noise report" style="width:100%;height:760px;border:0"></iframe>'


def _estimate(parameter: Mapping[str, Any]) -> Estimate:
    # JSON has no infinity.
    high = parameter.get("high")
    value, low = parameter.get("value"), parameter.get("low")
    return Estimate(
        float("nan") if value is None else float(value),
        float("nan") if low is None else float(low),
        float("inf") if high is None else float(high),
        str(parameter["unit"]),
    )


def _estimates(parameters: Mapping[str, Any]) -> dict[str, Estimate]:
    return {name: _estimate(parameter) for name, parameter in parameters.items()}


def _finding(finding: Mapping[str, Any]) -> Finding:
    own = finding["in_channels"]
    parameters = {name: _estimates(own.get(name, finding["parameters"])) for name in finding["channels"]}
    return Finding(
        kind=finding["kind"],
        channels=tuple(finding["channels"]),
        parameters=parameters,
        evidence=finding["evidence"],
        validated=finding["validated"],
    )


def _channel(channel: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> Channel:
    curve = channel["curve"]

    def column(name: str) -> Floats:
        return _read_only([np.inf if point[name] is None else point[name] for point in curve], np.float64)

    coefficients = {row["kind"]: _estimate(row) for row in rows if row["channel"] == channel["name"]}
    return Channel(
        name=channel["name"],
        unit=channel["unit"],
        samples=channel["samples"],
        coefficients=coefficients,
        n=_read_only([point["n"] for point in curve], np.int64),
        tau=column("tau_s"),
        adev=column("adev"),
        low=column("low"),
        high=column("high"),
        edf=column("edf"),
        model=_read_only(channel["final"]["adev"], np.float64),
        error_before=channel["before"]["unseen"]["deviance_per_point"],
        error_after=channel["after"]["unseen"]["deviance_per_point"],
    )
