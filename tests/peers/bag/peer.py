"""One peer on a recording: peer.py NAME INPUT OUTPUT. Prints what it states of gyro x and z as JSON: N, B, K in degrees and seconds.

`read` turns the bag INPUT into the table OUTPUT, which is the input of the others.
"""

import contextlib
import io
import json
import re
import sys
from pathlib import Path

import numpy as np

RATE_HZ = 100.0
AXES = (0, 2)


def read(bag, table):
    from rosbags.rosbag1 import Reader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    rows = []
    with Reader(bag) as reader:
        for connection, _, data in reader.messages():
            message = store.deserialize_ros1(data, connection.msgtype)
            rate, force = message.angular_velocity, message.linear_acceleration
            rows.append((rate.x, rate.y, rate.z, force.x, force.y, force.z))
    np.save(table, np.array(rows))


def with_allantools(table, _):
    """It has curves and no coefficients."""
    import allantools

    data = np.load(table)
    for at in range(6):
        allantools.oadev(data[:, at], rate=RATE_HZ, data_type="freq", taus="octave")
    return [[None] * 3] * len(AXES)


def with_avar(table, _):
    """Least squares of white noise and random walk, which the key `o` starts in its figure; it has no flicker noise."""
    import matplotlib

    matplotlib.use("Agg")
    import avar

    data = np.load(table)
    data[:, :3] = np.rad2deg(data[:, :3])
    sizes = avar.windows(len(data))
    times = sizes / RATE_HZ
    with contextlib.redirect_stdout(io.StringIO()):
        curves = avar.variance(np.ascontiguousarray(data.T), sizes)
    result = []
    for curve in curves:
        at_one_second = curve[np.argmin(abs(times - 1.0))]
        figure = avar.fit(times, curve, T=1.0 / RATE_HZ, ks=[(-1, at_one_second), (1, at_one_second / 1e4)])
        figure.on_key_press(type("Key", (), {"key": "o"}))
        white, walk = (variance**0.5 for _, variance in figure.ks)
        result.append([white, None, walk])
    return [result[at] for at in AXES]


def with_analyzer(table, folder):
    """Its class, as its documentation calls it; what it prints is read."""
    from allan_variance_analyzer.base import AllanVarianceAnalyzer

    folder = Path(folder)
    folder.mkdir(exist_ok=True)
    (folder / "config.yaml").write_text(f"imu_topic: /imu\nimu_rate: {RATE_HZ:.0f}\nmeasure_rate: {RATE_HZ:.0f}\nsequence_time: 100000\n")
    data = np.load(table)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
        AllanVarianceAnalyzer(folder / "config.yaml", folder).run(np.roll(data, 3, axis=1))  # accelerometers first
    return printed_coefficients(printed.getvalue())


def printed_coefficients(text):
    """N, the minimum of the curve as B, and K of the gyros, from the lines that both programs print."""
    lines = ("Angle Random Walk", "Bias Instability", "Rate Random Walk")
    gyros = text.partition("GYROSCOPE:")[2]
    return [[float(re.search(rf"{axis} {line}:\s*(\S+)", gyros)[1]) for line in lines] for axis in "XZ"]


PEERS = {"allantools": with_allantools, "avar": with_avar, "allan-variance-analyzer": with_analyzer}

if __name__ == "__main__":
    name, source, output = sys.argv[1:]
    if name == "read":
        read(source, output)
    else:
        print(json.dumps(PEERS[name](source, output)))
