"""A recording of a sensor at rest, made here: white noise of a stated size in every channel."""

from __future__ import annotations

import csv
import io
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

RATE = 200.0  # Hz
# Standard deviations of a sample: rad/s and m/s².
GYRO, ACCELEROMETER = 2e-3, 2e-2
NAMES = ["time", "gyro_x", "gyro_y", "gyro_z", "accl_x", "accl_y", "accl_z"]
UNITS = ["rad/s", "m/s^2", "ns"]


def columns(rows: int = 20_000, seed: int = 1) -> dict[str, npt.NDArray[Any]]:
    """Times in ns since 1970, angular rates in rad/s, specific forces in m/s², one of which has gravity."""
    random = np.random.default_rng(seed)
    table: dict[str, npt.NDArray[Any]] = {
        "time": 1_700_000_000_000_000_000 + np.arange(rows, dtype=np.int64) * int(1e9 / RATE)
    }
    for name in NAMES[1:]:
        is_gyro = name.startswith("gyro")
        noise = random.normal(0.0, GYRO if is_gyro else ACCELEROMETER, rows)
        table[name] = noise + (9.80665 if name == "accl_z" else 0.0)
    return table


def as_csv(table: dict[str, npt.NDArray[Any]]) -> bytes:
    """The same as text, to the last digit."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(zip(*(column.tolist() for column in table.values()), strict=True))
    return text.getvalue().encode()


def as_bag(table: dict[str, npt.NDArray[Any]]) -> bytes:
    """The same as a bag of ROS 1."""
    store = get_typestore(Stores.ROS1_NOETIC)
    imu, header, stamp, vector, quaternion = (
        store.types[name]
        for name in (
            "sensor_msgs/msg/Imu",
            "std_msgs/msg/Header",
            "builtin_interfaces/msg/Time",
            "geometry_msgs/msg/Vector3",
            "geometry_msgs/msg/Quaternion",
        )
    )
    unknown = np.zeros(9)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "imu.bag"
        with Writer(path) as bag:
            connection = bag.add_connection("/imu", imu.__msgtype__, typestore=store)
            for row, (time, *values) in enumerate(zip(*(column.tolist() for column in table.values()), strict=True)):
                gyro, accl = vector(*values[:3]), vector(*values[3:])
                at = header(row, stamp(*divmod(time, 1_000_000_000)), "imu")
                message = imu(at, quaternion(0.0, 0.0, 0.0, 1.0), unknown, gyro, unknown, accl, unknown)
                bag.write(connection, time, store.serialize_ros1(message, imu.__msgtype__))
        return path.read_bytes()
