"""Writes a ROS 1 bag of `sensor_msgs/Imu` at 100 Hz: write.py FILE SECONDS.

Each axis has white noise, flicker noise and a random walk of known coefficients. Gyro z has a line besides.
"""

import sys

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

RATE_HZ = 100.0
# N, B, K of the gyros in deg/s^0.5, deg/s, deg/s^1.5, and of the accelerometers in m/s^1.5, m/s^2, m/s^2.5
TRUTH = {"gyro": (0.02, 0.006, 0.0004), "accl": (0.002, 0.0006, 0.00004)}
LINE = (20.3, 0.1)  # Hz and deg/s


def noise(random, samples, white, flicker, walk):
    """The three processes of IEEE 952; the two-sided density of the flicker noise is B²/(2πf)."""
    frequencies = np.fft.rfftfreq(2 * samples, 1.0 / RATE_HZ)
    frequencies[0] = np.inf
    gain = flicker * np.sqrt(RATE_HZ / (2.0 * np.pi * frequencies))
    slow = np.fft.irfft(np.fft.rfft(random.normal(size=2 * samples)) * gain)[:samples]
    steps = random.normal(scale=walk / np.sqrt(RATE_HZ), size=samples)
    return random.normal(scale=white * np.sqrt(RATE_HZ), size=samples) + slow + np.cumsum(steps)


def rows(samples):
    random = np.random.default_rng(952)
    table = np.stack([noise(random, samples, *TRUTH[kind]) for kind in TRUTH for _ in "xyz"], axis=1)
    frequency, amplitude = LINE
    table[:, 2] += amplitude * np.sin(2.0 * np.pi * frequency / RATE_HZ * np.arange(samples))
    table[:, 5] += 9.80665
    table[:, :3] = np.deg2rad(table[:, :3])
    return table.tolist()


def main():
    file, samples = sys.argv[1], round(float(sys.argv[2]) * RATE_HZ)
    store = get_typestore(Stores.ROS1_NOETIC)
    geometry = "geometry_msgs/msg/"
    vector, quaternion = store.types[geometry + "Vector3"], store.types[geometry + "Quaternion"]
    header, imu = store.types["std_msgs/msg/Header"], store.types["sensor_msgs/msg/Imu"]
    time = store.types["builtin_interfaces/msg/Time"]
    unknown = np.zeros(9)
    no_orientation = np.array([-1.0] + [0.0] * 8)
    with Writer(file) as writer:
        topic = writer.add_connection("/imu", imu.__msgtype__, typestore=store)
        for at, row in enumerate(rows(samples)):
            stamp = 1_000_000_000 + round(at / RATE_HZ * 1e9)
            head = header(at, time(*divmod(stamp, 1_000_000_000)), "imu")
            rate, force = vector(*row[:3]), vector(*row[3:])
            message = imu(head, quaternion(0.0, 0.0, 0.0, 1.0), no_orientation, rate, unknown, force, unknown)
            writer.write(topic, stamp, store.serialize_ros1(message, imu.__msgtype__))


if __name__ == "__main__":
    main()
