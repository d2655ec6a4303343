#!/usr/bin/env python3
"""Allan deviations of a recording by other programs: its reader, and allantools.

    python3 reference_curves.py READER FILE [ARGUMENT]

Prints in JSON by channel the overlapping Allan deviation at 1, 2, 4 and 8 samples, in deg/s or g, of a recording without gaps; with them, of
the samples between which the time is less than 1.5 times the median, at 1 sample; and the sum of all values, each times its row from 1.
"""

import json
import sys

import allantools
import numpy as np

GRAVITY = 9.80665
CHANNELS = ["gyro_x", "gyro_y", "gyro_z", "accl_x", "accl_y", "accl_z"]


def ros1_bag(file, topic):
    from rosbags.highlevel import AnyReader
    from pathlib import Path

    with AnyReader([Path(file)]) as reader:
        connections = [found for found in reader.connections if found.topic == topic]
        rows = []
        for connection, _, data in reader.messages(connections):
            message = reader.deserialize(data, connection.msgtype)
            rate, force = message.angular_velocity, message.linear_acceleration
            rows.append([rate.x, rate.y, rate.z, force.x, force.y, force.z])
    rows = np.array(rows)
    return None, np.c_[np.degrees(rows[:, :3]), rows[:, 3:] / GRAVITY]


def matlab_structure(file, name):
    import scipy.io

    board = scipy.io.loadmat(file, struct_as_record=False, squeeze_me=True)[name]
    return None, np.c_[np.degrees(board.wb), board.fb / GRAVITY]


def hdf5(file, dataset):
    import h5py

    with h5py.File(file) as opened:
        return None, np.asarray(opened[dataset])[1:4].T


def ulog(file, topic):
    from pyulog import ULog

    data = next(found.data for found in ULog(file).data_list if found.name == topic)
    rates = np.c_[tuple(data[f"gyro_rad[{axis}]"] for axis in range(3))]
    forces = np.c_[tuple(data[f"accelerometer_m_s2[{axis}]"] for axis in range(3))]
    return data["timestamp"].astype(float), np.c_[np.degrees(rates), forces / GRAVITY]


def text(file, columns):
    """Columns of a table without gaps, and the size of 1 in each, as in `1:1,2:0.001`."""
    chosen = [part.split(":") for part in columns.split(",")]
    with open(file) as lines:
        rows = [line.replace(",", " ").split() for line in lines]
    numbers = [row for row in rows if row and all(field.lstrip("+-")[:1].isdigit() for field in row)]
    values = np.array([[float(row[int(at)]) for at, _ in chosen] for row in numbers])
    return None, values * [float(size) for _, size in chosen]


def main():
    reader, file, *rest = sys.argv[1:]
    times, values = globals()[reader](file, *(rest or [None]))
    found = {}
    channels = CHANNELS[3:] if reader == "hdf5" else CHANNELS[: values.shape[1]]
    for channel, column in zip(channels, values.T):
        if times is None:
            _, deviations, _, _ = allantools.oadev(column, rate=1.0, data_type="freq", taus=[1, 2, 4, 8])
        else:
            steps = np.diff(times)
            near = (steps > 0) & (steps < 1.5 * np.median(steps))
            deviations = [np.sqrt(np.mean(np.diff(column)[near] ** 2) / 2)]
        found[channel] = [float(deviation) for deviation in deviations]
    sums = np.arange(1, len(values) + 1) @ values
    print(json.dumps(dict(rows=len(values), curves=found, sums=dict(zip(channels, sums)))))


main()
