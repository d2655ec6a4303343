#!/usr/bin/env python3
"""Writes a small recording of every format that other programs write, with known noise, rate and losses.

    python3 make_samples.py FOLDER

Needs numpy, scipy, h5py, rosbags, mcap, mcap-ros2-support, pyulog, and pymavlink, and sigrok-cli for its SPI decoder. The writers are
those of the formats' own projects (numpy, scipy, h5py, rosbags, mcap). ULog and ArduPilot logs have no writer in Python: the bytes
are written here and read back by pyulog and pymavlink, which must find every sample. FOLDER/truth.json says what each file holds: arguments, rate in
Hz, rows, samples that are missing between them, the angle random walk of each channel in deg/s/sqrt(Hz) or g/sqrt(Hz) that was
drawn from, and, computed by numpy from the samples that were written, the Allan deviation of neighbours in deg/s or g and the
angle random walk sigma/sqrt(rate), the maximum-likelihood estimate for white noise.
"""

import json
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import scipy.io

GRAVITY = 9.80665
ROWS = 6_000
RATE = 200.0
# Standard deviations of white noise.
GYRO_SIGMA = np.radians([0.05, 0.07, 0.09])  # rad/s
ACCL_SIGMA = np.array([0.002, 0.003, 0.004]) * GRAVITY  # m/s^2
GYRO = ["gyro_x", "gyro_y", "gyro_z"]
ACCL = ["accl_x", "accl_y", "accl_z"]
# Samples that never arrive: single ones, and an outage.
LOST = np.r_[500, 1_500, 2_777, 4_000:4_040, 5_501]
START_NS = 1_700_000_000_000_000_000


def samples(seed, rows=ROWS, rate=RATE):
    """Times in ns, rates in rad/s, forces in m/s^2, without the lost rows."""
    random = np.random.default_rng(seed)
    gyro = random.normal(0.0, GYRO_SIGMA, (rows, 3)) + [0.01, -0.02, 0.005]
    accl = random.normal(0.0, ACCL_SIGMA, (rows, 3)) + [0.1, -0.05, GRAVITY]
    times = START_NS + np.round(np.arange(rows) * 1e9 / rate + random.uniform(0.0, 0.02e9 / rate, rows)).astype(np.int64)
    kept = np.setdiff1d(np.arange(rows), LOST)
    return times[kept], gyro[kept], accl[kept]


def noise(channels, rate=RATE):
    return {channel: float(SIGMAS[channel] / np.sqrt(rate)) for channel in channels}


class Truth(list):
    """What the files hold."""

    def add(self, file, samples, arguments=(), rate=RATE, kept=None):
        """`samples` by channel in deg/s or g, of which those at the positions `kept` of a complete record were written."""
        rows = len(next(iter(samples.values())))
        kept = np.arange(rows) if kept is None else np.asarray(kept)
        neighbours = np.diff(kept) == 1
        missing = int(kept[-1] - kept[0] + 1 - rows)
        known = dict(file=str(file), arguments=list(arguments), rate_hz=rate, rows=rows, missing=missing)
        deviation = lambda values: np.sqrt(np.mean(np.diff(values)[neighbours] ** 2) / 2)
        known["neighbours"] = {name: float(deviation(values)) for name, values in samples.items()}
        known["sample_walk"] = {name: float(np.std(values) / np.sqrt(rate)) for name, values in samples.items()}
        known["angle_random_walk"] = noise([name for name in samples if name in SIGMAS], rate)
        self.append(known)
        return known


SIGMAS = dict(zip(GYRO, np.degrees(GYRO_SIGMA))) | dict(zip(ACCL, ACCL_SIGMA / GRAVITY))
KEPT = np.setdiff1d(np.arange(ROWS), LOST)


def rates(gyro):
    """By channel, of columns in rad/s."""
    return dict(zip(GYRO, np.degrees(gyro).T))


def both(gyro, accl):
    """By channel, of columns in rad/s and m/s^2."""
    return rates(gyro) | dict(zip(ACCL, accl.T / GRAVITY))


def tables(folder, truth):
    times, gyro, accl = samples(1)
    seconds = (times - times[0]) / 1e9
    columns = np.c_[seconds, np.degrees(gyro), accl]
    header = "time_s,gyro_x_deg_s,gyro_y_deg_s,gyro_z_deg_s,ax [m/s^2],ay [m/s^2],az [m/s^2]"
    np.savetxt(folder / "units.csv", columns, delimiter=",", header=header, comments="", fmt="%.9f")
    truth.add("units.csv", both(gyro, accl), kept=KEPT)
    # The headings of EuRoC's imu0/data.csv.
    euroc = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    euroc += "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
    with open(folder / "euroc.csv", "w") as out:
        print(euroc, file=out)
        for time, rate, force in zip(times, gyro, accl):
            print(time, *rate, *force, sep=",", file=out)
    truth.add("euroc.csv", both(gyro, accl), kept=KEPT)
    with open(folder / "semicolon.csv", "w") as out:
        print("t;p;q;r", file=out)
        for time, rate in zip(seconds, np.degrees(gyro) * 1e3):
            print(*(f"{value:.6f}".replace(".", ",") for value in [time * 1e3, *rate]), sep=";", file=out)
    named = ["--columns", "time=t,gyro_x=p,gyro_y=q,gyro_z=r", "--units", "ms,mdeg/s"]
    truth.add("semicolon.csv", rates(gyro), named, kept=KEPT)
    # Counts of the included profile of an MPU-6050: 131 LSB per deg/s.
    counts = np.round(np.degrees(gyro) * 131).astype(int)
    table = np.c_[np.round(seconds * 1e6).astype(int), counts]
    np.savetxt(folder / "counts.tsv", table, delimiter="\t", header="time_us\tgx_raw\tgy_raw\tgz_raw", comments="", fmt="%d")
    truth.add("counts.tsv", dict(zip(GYRO, counts.T / 131)), ["--sensor", "mpu6050"], kept=KEPT)


def numpy_arrays(folder, truth):
    times, gyro, accl = samples(2)
    np.save(folder / "matrix.npy", gyro)
    # Without time stamps the lost samples are not seen.
    chosen = ["--columns", "gyro_x=0,gyro_y=1,gyro_z=2", "--units", "rad/s", "--rate", "200"]
    truth.add("matrix.npy", rates(gyro), chosen)
    np.save(folder / "transposed.npy", np.asfortranarray(np.c_[(times - times[0]) / 1e9, gyro].T.astype(">f8")))
    chosen = ["--columns", "time=0,gyro_x=1,gyro_y=2,gyro_z=3", "--units", "rad/s,s"]
    truth.add("transposed.npy", rates(gyro), chosen, kept=KEPT)
    fields = [("t_us", "<i8")] + [(name, "<f4") for name in ["gx", "gy", "gz", "ax", "ay", "az"]]
    records = np.zeros(len(times), fields)
    for name, column in zip(records.dtype.names, [(times - times[0]) // 1000, *gyro.T, *accl.T]):
        records[name] = column
    np.save(folder / "records.npy", records)
    truth.add("records.npy", both(gyro, accl), ["--units", "rad/s,m/s^2"], kept=KEPT)
    np.savez_compressed(folder / "arrays.npz", stamp=times, gyro=gyro, accel=accl / GRAVITY, note=np.array("text"))
    truth.add("arrays.npz", both(gyro, accl), ["--units", "ns,rad/s,g"], kept=KEPT)


def matlab(folder, truth):
    times, gyro, accl = samples(3)
    arrays = dict(time=(times - times[0])[:, None] / 1e9, gyro=gyro, accel=accl, name="bench")
    for file, compressed in [("level5.mat", False), ("compressed.mat", True)]:
        scipy.io.savemat(folder / file, arrays, do_compression=compressed)
        truth.add(file, both(gyro, accl), ["--units", "s,rad/s,m/s^2"], kept=KEPT)


def ros_bags(folder, truth):
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    times, gyro, accl = samples(4)

    def write(writer, topics, store, serialize):
        types = store.types
        kind = "sensor_msgs/msg/Imu"
        vector, zeros = types["geometry_msgs/msg/Vector3"], np.zeros(9)
        extra = dict(seq=0) if store is ros1 else {}
        with writer:
            connections = [writer.add_connection(topic, kind, typestore=store) for topic in topics]
            for time, rate, force in zip(times, gyro, accl):
                stamp = types["builtin_interfaces/msg/Time"](sec=int(time // 10**9), nanosec=int(time % 10**9))
                message = types[kind](
                    header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="imu", **extra),
                    orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
                    orientation_covariance=zeros,
                    angular_velocity=vector(*map(float, rate)),
                    angular_velocity_covariance=zeros,
                    linear_acceleration=vector(*map(float, force)),
                    linear_acceleration_covariance=zeros,
                )
                for connection in connections:
                    # Written 3 ms late and more: the stamp in the header is the time of the sample.
                    writer.write(connection, int(time) + 3_000_000, serialize(message, kind))

    ros1, ros2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
    bag = Writer1(folder / "one.bag")
    bag.set_compression(Writer1.CompressionFormat.LZ4)
    write(bag, ["/imu/data"], ros1, ros1.serialize_ros1)
    truth.add("one.bag", both(gyro, accl), kept=KEPT)
    write(Writer1(folder / "two.bag"), ["/imu/data", "/imu/other"], ros1, ros1.serialize_ros1)
    truth.add("two.bag", both(gyro, accl), ["--topic", "/imu/other"], kept=KEPT)
    for name, plugin, ending in [("mcap", StoragePlugin.MCAP, "mcap"), ("sqlite", StoragePlugin.SQLITE3, "db3")]:
        writer = Writer2(folder / name, version=9, storage_plugin=plugin)
        write(writer, ["/imu/data"], ros2, ros2.serialize_cdr)
        truth.add(f"{name}/{name}.{ending}", both(gyro, accl), kept=KEPT)

    # The same by Foxglove's own writer, compressed in chunks.
    from mcap_ros2.writer import Writer as McapWriter

    definition = ros2.generate_msgdef("sensor_msgs/msg/Imu", ros_version=2)[0]
    with open(folder / "foxglove.mcap", "wb") as out:
        writer = McapWriter(out)
        schema = writer.register_msgdef("sensor_msgs/msg/Imu", definition)
        for number, (time, rate, force) in enumerate(zip(times, gyro, accl)):
            axes = lambda values: dict(zip("xyz", map(float, values)))
            stamp = dict(sec=int(time // 10**9), nanosec=int(time % 10**9))
            message = dict(header=dict(stamp=stamp, frame_id="a_longer_name"), angular_velocity=axes(rate))
            message |= dict(orientation=dict(x=0.0, y=0.0, z=0.0, w=1.0), linear_acceleration=axes(force))
            covariances = ["orientation", "angular_velocity", "linear_acceleration"]
            message |= {f"{name}_covariance": [0.0] * 9 for name in covariances}
            writer.write_message("/imu", schema, message, log_time=int(time), publish_time=int(time), sequence=number)
        writer.finish()
    truth.add("foxglove.mcap", both(gyro, accl), kept=KEPT)


def ulog(folder, truth):
    """ULog by its specification; pyulog reads it back."""
    from pyulog import ULog

    times, gyro, accl = samples(5)
    micros = (times - START_NS) // 1000 + 1_000_000

    def message(kind, payload):
        return struct.pack("<HB", len(payload), ord(kind)) + payload

    def log(formats, subscriptions, data):
        header = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
        flags = message("B", bytes(40))
        head = b"".join(message("F", text.encode()) for text in formats)
        for number, name, *instance in subscriptions:
            head += message("A", struct.pack("<BH", *(instance or [0]), number) + name.encode())
        return header + flags + head + b"".join(message("D", payload) for payload in data)

    single = "{}:uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;"
    formats = [single.format("sensor_gyro"), single.format("sensor_accel")]
    data = []
    for time, rate, force in zip(micros, gyro, accl):
        # Published later than sampled.
        data.append(struct.pack("<HQQIfff", 0, time + 700, time, 1, *rate))
        data.append(struct.pack("<HQQIfff", 1, time + 900, time, 2, *force))
    (folder / "single.ulg").write_bytes(log(formats, [(0, "sensor_gyro"), (1, "sensor_accel")], data))
    read = {topic.name: topic.data for topic in ULog(str(folder / "single.ulg")).data_list}
    assert np.array_equal(read["sensor_gyro"]["timestamp_sample"], micros)
    assert np.allclose(read["sensor_accel"]["z"], accl[:, 2], rtol=1e-6)
    # Both messages have the same times: they are read as one.
    truth.add("single.ulg", both(gyro, accl), kept=KEPT)
    truth.add("single.ulg", dict(zip(ACCL, accl.T / GRAVITY)), ["--topic", "sensor_accel"], kept=KEPT)

    # Two publishers of one message, the second with other noise and other times.
    second = samples(25)
    data = [(time, struct.pack("<HQQIfff", 0, time + 700, time, 1, *rate)) for time, rate in zip(micros, gyro)]
    later = (second[0] - START_NS) // 1000 + 1_001_000
    data += [(time, struct.pack("<HQQIfff", 1, time + 700, time, 2, *rate)) for time, rate in zip(later, 2 * second[1])]
    data = [payload for _, payload in sorted(data)]
    (folder / "instances.ulg").write_bytes(log(formats[:1], [(0, "sensor_gyro"), (1, "sensor_gyro", 1)], data))
    truth.add("instances.ulg", rates(gyro), kept=KEPT)
    known = truth.add("instances.ulg", rates(2 * second[1]), ["--topic", "sensor_gyro:1"], kept=KEPT)
    known["angle_random_walk"] = {name: 2 * walk for name, walk in noise(GYRO).items()}

    # FIFO: 8 samples of 16 bits a message at 8 kHz; three messages are lost. The range is small enough that the step, a seventh
    # of the noise, adds no more than 0.2 % to its variance.
    rate, each, scale = 8000.0, 8, np.radians(250.0) / 32768
    random = np.random.default_rng(6)
    counts = np.round(random.normal(0.0, GYRO_SIGMA, (4 * ROWS, 3)) / scale).astype(int)
    fifo = "sensor_gyro_fifo:uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float dt;float scale;"
    fifo += "uint8_t samples;int16_t[32] x;int16_t[32] y;int16_t[32] z;"
    lost = {100, 1_000, 2_555}
    data = []
    for number in sorted(set(range(len(counts) // each)) - lost):
        time = 1_000_000 + ((number + 1) * each - 1) * 125
        block = np.zeros((32, 3), int)
        block[:each] = counts[number * each : (number + 1) * each]
        data.append(struct.pack("<HQQIffB96h", 0, time + 50, time, 1, 125.0, scale, each, *block.T.ravel()))
    (folder / "fifo.ulg").write_bytes(log([fifo], [(0, "sensor_gyro_fifo")], data))
    topic = ULog(str(folder / "fifo.ulg")).data_list[0].data
    assert len(topic["x[0]"]) == len(counts) // each - len(lost) and topic["y[7]"][0] == counts[7, 1]
    kept = [at for at in range(len(counts)) if at // each not in lost]
    truth.add("fifo.ulg", rates(counts[kept] * scale), rate=rate, kept=kept)


def ardupilot(folder, truth):
    """DataFlash by its format messages; pymavlink reads it back."""
    from pymavlink import DFReader

    times, gyro, accl = samples(7)
    micros = (times - START_NS) // 1000 + 5_000_000
    sizes = dict(zip("bBhHiIfQaMnNZ", [1, 1, 2, 2, 4, 4, 4, 8, 64, 1, 4, 16, 64]))

    def fmt(kind, name, types, labels):
        length = 3 + sum(sizes[letter] for letter in types)
        text = struct.pack("<BB4s16s64s", kind, length, name.encode(), types.encode(), labels.encode())
        return b"\xa3\x95\x80" + text

    def message(kind, *fields):
        return bytes([0xA3, 0x95, kind]) + struct.pack(*fields)

    head = fmt(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
    head += fmt(130, "IMU", "QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz")
    head += fmt(131, "ISBH", "QHBBHHQf", "TimeUS,N,type,instance,mul,smp_cnt,SampleUS,smp_rate")
    head += fmt(132, "ISBD", "QHHaaa", "TimeUS,N,seqno,x,y,z")
    imu = b"".join(
        message(130, "<QBffffffIIfBBHH", time, 0, *rate, *force, 0, 0, 41.5, 1, 1, 1000, 1000)
        for time, rate, force in zip(micros, gyro, accl)
    )
    (folder / "imu.bin").write_bytes(head + imu)

    def read_back(file, kind):
        log = DFReader.DFReader_binary(str(folder / file))
        return [found for found in iter(lambda: log.recv_match(type=kind), None)]

    found = read_back("imu.bin", "IMU")
    assert len(found) == len(micros) and abs(found[9].GyrX - gyro[9, 0]) < 1e-6
    truth.add("imu.bin", both(gyro, accl), kept=KEPT)

    # Batches of 1024 raw samples at 2 kHz, every 0.75 s: the gaps between them are as long as 476 samples. One message of
    # 32 samples is lost.
    rate, size, every, multiplier, batches = 2000.0, 1024, 1500, 900, 20
    counts = np.round(np.random.default_rng(8).normal(0.0, GYRO_SIGMA, (batches * size, 3)) * multiplier * 16).astype(int)
    body, lost = [], (7, 11)
    for batch in range(batches):
        start = 3_000_000 + batch * every * 500
        body.append(message(131, "<QHBBHHQf", start + 600_000, batch, 1, 0, multiplier * 16, size, start, rate))
        for sequence in range(size // 32):
            block = counts[batch * size + 32 * sequence :][:32]
            if (batch, sequence) != lost:
                body.append(message(132, "<QHH96h", start + 600_100, batch, sequence, *block.T.ravel()))
    (folder / "batches.bin").write_bytes(head + b"".join(body))
    found = read_back("batches.bin", "ISBD")
    assert len(found) == batches * size // 32 - 1 and list(found[0].x) == list(counts[:32, 0])
    sent = np.setdiff1d(np.arange(batches * size), lost[0] * size + 32 * lost[1] + np.arange(32))
    kept = sent // size * every + sent % size
    truth.add("batches.bin", rates(counts[sent] / (multiplier * 16)), rate=rate, kept=kept)


def spi_captures(folder, truth):
    """Burst reads of an ADIS16405 on the bus: decoded by sigrok from a capture of the four lines, and as Saleae exports them."""
    rows, rate, lost = 1500, 200.0, [200, 700, 701]
    random = np.random.default_rng(9)
    # Supply 5 V, then three rates, three forces and three fields, temperature 25 degC, auxiliary input.
    level = np.array([2068, 0, 10, -20, 0, 30, 300, 100, -200, 400, 0, 0])
    sigma = np.array([1, 8, 9, 10, 4, 4, 4, 3, 3, 3, 1, 1])
    counts = np.round(level + random.normal(0, 1, (rows, 12)) * sigma).astype(int)
    # Bit 15 says that the word is new; supply, temperature and auxiliary input have 12 bits, the others 14.
    words = np.where(np.isin(np.arange(12), [0, 10, 11]), counts & 0xFFF, counts & 0x3FFF) | 0x8000
    frames = []  # time in us, bytes out, bytes in
    for row in sorted(set(range(rows)) - set(lost)):
        out, back = bytes([0x3E, 0]) + bytes(24), bytes(2) + words[row].astype(">u2").tobytes()
        frames.append((1_000 + row * 5_000, out, back))
    lsb = dict(gyro_x=(1, 0.05), gyro_y=(2, 0.05), gyro_z=(3, 0.05), accl_x=(4, 3.33e-3), accl_y=(5, 3.33e-3), accl_z=(6, 3.33e-3))
    kept = np.setdiff1d(np.arange(rows), lost)

    def add(file):
        known = truth.add(file, {name: counts[kept, at] * size for name, (at, size) in lsb.items()}, rate=rate, kept=kept)
        known["angle_random_walk"] = {name: float(sigma[at] * size / np.sqrt(rate)) for name, (at, size) in lsb.items()}

    # SPI mode 3 at 500 kHz; one time unit is 1 us, the high and the low of the clock take one each.
    lines = ["$timescale 1 us $end", "$scope module bus $end"]
    lines += [f"$var wire 1 {letter} {name} $end" for letter, name in zip("abcd", ["CS", "CLK", "MOSI", "MISO"])]
    lines += ["$upscope $end", "$enddefinitions $end", "#0", "1a", "1b", "0c", "0d"]
    for time, out, back in frames:
        lines += [f"#{time}", "0a"]
        for sent, received in zip(out, back):
            for bit in range(7, -1, -1):
                time += 1
                lines += [f"#{time}", "0b", f"{sent >> bit & 1}c", f"{received >> bit & 1}d", f"#{time + 1}", "1b"]
                time += 1
        lines += [f"#{time + 1}", "1a"]
    lines.append(f"#{time + 100}")
    (folder / "bus.vcd").write_text("\n".join(lines) + "\n")
    decoder = "spi:clk=CLK:mosi=MOSI:miso=MISO:cs=CS:cpol=1:cpha=1"
    command = ["sigrok-cli", "-I", "vcd", "-i", str(folder / "bus.vcd"), "-P", decoder]
    command += ["-A", "spi=mosi-transfer:miso-transfer", "--protocol-decoder-jsontrace"]
    if shutil.which(command[0]):
        (folder / "sigrok.json").write_bytes(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
        add("sigrok.json")
    # Saleae has no writer outside its program: its columns, as Logic 2 names them.
    with open(folder / "saleae_table.csv", "w") as table:
        print('name,type,start_time,duration,"mosi","miso"', file=table)
        for time, out, back in frames:
            start = time / 1e6
            print(f'"SPI","enable",{start:.9f},8e-09,,', file=table)
            for at, (sent, received) in enumerate(zip(out, back)):
                byte = start + 1e-6 + at * 16e-6
                print(f'"SPI","result",{byte:.9f},1.5e-05,0x{sent:02X},0x{received:02X}', file=table)
            print(f'"SPI","disable",{start + 420e-6:.9f},8e-09,,', file=table)
    add("saleae_table.csv")


def drawn_messages(folder, truth):
    """Bags whose types of messages, nesting and order of fields are drawn at random; somewhere in them are two Vector3."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    rows = 1500
    kept = np.setdiff1d(np.arange(rows), LOST)
    numbers = dict(bool=bool, int8=np.int8, uint8=np.uint8, int16=np.int16, uint16=np.uint16, int32=np.int32)
    numbers |= dict(uint32=np.uint32, int64=np.int64, uint64=np.uint64, float32=np.float32, float64=np.float64)

    def drawn(random, kind, shape=None):
        if kind is bool:
            return random.integers(0, 2, shape).astype(bool) if shape else bool(random.integers(0, 2))
        if np.issubdtype(kind, np.floating):
            value = random.normal(0, 1e3, shape).astype(kind) if shape else float(kind(random.normal(0, 1e3)))
            return value
        low, high = np.iinfo(kind).min // 2, np.iinfo(kind).max // 2
        return random.integers(low, high, shape, dtype=kind) if shape else int(random.integers(low, high, dtype=kind))

    def write(case, version):
        random = np.random.default_rng([case, version])
        store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
        package = f"drawn{case}"
        letters = list("bcdfghklmnpqrtuvz")
        word = lambda: "".join(random.choice(letters, random.integers(3, 9))) + str(random.integers(0, 100))

        def fillers():
            """Pairs of a field's definition and a function that draws its value."""
            found = []
            for _ in range(random.integers(1, 6)):
                name, kind = word(), str(random.choice(list(numbers)))
                count = int(random.integers(1, 6))
                form = random.integers(0, 5)
                if form == 0:
                    found.append((f"string {name}", name, lambda: "x" * int(random.integers(0, 9))))
                elif form == 1:
                    found.append((f"{kind}[{count}] {name}", name, lambda kind=kind, count=count: drawn(random, numbers[kind], (count,))))
                elif form == 2:
                    found.append((f"{kind}[] {name}", name, lambda kind=kind: drawn(random, numbers[kind], (int(random.integers(1, 5)),))))
                elif form == 3:
                    found.append((f"string[] {name}", name, lambda: ["y" * int(random.integers(0, 5))] * int(random.integers(0, 3))))
                else:
                    found.append((f"{kind} {name}", name, lambda kind=kind: drawn(random, numbers[kind])))
            # A constant is no field; a comment is none either.
            return found + [("uint8 LIMIT=3  # not in the message", None, None)]

        vector = "geometry_msgs/Vector3"
        has_header, depth = case % 4 != 3, int(random.integers(0, 4))
        header_level = int(random.integers(0, depth + 1))
        types, inner = [], None
        for level in range(depth + 1):
            fields = fillers()
            if level == 0:
                fields += [(f"{vector} angular_velocity", "angular_velocity", "rate"), (f"{vector} linear_acceleration", "linear_acceleration", "force")]
            else:
                name = word()
                fields.append((f"{package}/{types[-1][0]} {name}", name, "inner"))
            if has_header and level == header_level:
                name = str(random.choice(["header", "Header"]))
                fields.append((f"std_msgs/Header {name}", name, "header"))
            random.shuffle(fields)
            types.append((f"Level{level}", fields))
        definitions = {}
        for name, fields in types:
            text = "\n".join(definition for definition, *_ in fields)
            definitions |= get_types_from_msg(text, f"{package}/msg/{name}")
        store.register(definitions)
        times, gyro, accl = samples(100 + case, rows)

        def message(level, time, rate, force):
            name, fields = types[level]
            values = {}
            for _, field, value in fields:
                if field is None:
                    continue
                if value in ("rate", "force"):
                    value = store.types["geometry_msgs/msg/Vector3"](*map(float, rate if value == "rate" else force))
                elif value == "inner":
                    value = message(level - 1, time, rate, force)
                elif value == "header":
                    extra = dict(seq=0) if version == 1 else {}
                    stamp = store.types["builtin_interfaces/msg/Time"](sec=int(time // 10**9), nanosec=int(time % 10**9))
                    value = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="f" * int(random.integers(0, 7)), **extra)
                else:
                    value = value()
                values[field] = value
            return store.types[f"{package}/msg/{name}"](**values)

        if version == 1:
            file, writer = f"drawn{case}.bag", Writer1(folder / f"drawn{case}.bag")
            serialize = store.serialize_ros1
        else:
            plugin, ending = [(StoragePlugin.MCAP, "mcap"), (StoragePlugin.SQLITE3, "db3")][case % 2]
            file, writer = f"drawn{case}/drawn{case}.{ending}", Writer2(folder / f"drawn{case}", version=9, storage_plugin=plugin)
            serialize = store.serialize_cdr
        kind = f"{package}/msg/{types[-1][0]}"
        with writer:
            connection = writer.add_connection("/" + word(), kind, typestore=store)
            for time, rate, force in zip(times, gyro, accl):
                late = 3_000_000 if has_header else 0
                writer.write(connection, int(time) + late, serialize(message(depth, time, rate, force), kind))
        truth.add(file, both(gyro, accl), kept=kept)

    for case in range(6):
        write(case, 1)
    for case in range(10, 18):
        write(case, 2)


def matlab_structures(folder, truth):
    times, gyro, accl = samples(20)
    column = lambda values: np.asarray(values)[:, None]
    board = dict(t=column((times - times[0]) / 1e9), wb=gyro, fb=accl, mb=np.zeros((len(gyro), 3)), name="left")
    for file, compressed in [("structure.mat", False), ("structure_compressed.mat", True)]:
        scipy.io.savemat(folder / file, dict(setup=dict(note="bench", board=board)), do_compression=compressed)
        truth.add(file, both(gyro, accl), kept=KEPT)
    named = ",".join(f"{channel}_{axis}=setup.board.{field}.{at}" for channel, field in [("gyro", "wb"), ("accl", "fb")] for at, axis in enumerate("xyz"))
    truth.add("structure.mat", both(gyro, accl), ["--columns", f"time=setup.board.t,{named}", "--units", "s,rad/s,m/s^2"], kept=KEPT)
    # Two sensors in one file: each is read by its name.
    second = samples(21)
    other = dict(t=column((second[0] - second[0][0]) / 1e9), gyro=np.degrees(second[1]).astype(np.float32), acc=second[2] / GRAVITY)
    scipy.io.savemat(folder / "two_structures.mat", dict(first=board, second=other))
    truth.add("two_structures.mat", both(gyro, accl), ["--topic", "first"], kept=KEPT)
    truth.add("two_structures.mat", both(*second[1:]), ["--topic", "second", "--units", "deg/s,g"], kept=KEPT)
    # An array of structures with a sample each, as a loop in MATLAB fills it.
    rows = np.zeros(len(times), [("t", "O"), ("note", "O"), ("imu", "O")])
    for at, (time, rate, force) in enumerate(zip((times - times[0]) / 1e9, gyro, accl)):
        rows[at] = (time, "ok", dict(wb=rate, fb=column(force)))
    scipy.io.savemat(folder / "structure_array.mat", dict(log=rows), do_compression=True)
    fields = ",".join(f"{channel}=log.imu.{field}.{at}" for field, names in [("wb", GYRO), ("fb", ACCL)] for at, channel in enumerate(names))
    truth.add("structure_array.mat", both(gyro, accl), ["--columns", f"time=log.t,{fields}", "--units", "s,rad/s,m/s^2"], kept=KEPT)


def hdf5(folder, truth):
    import h5py

    times, gyro, accl = samples(22)
    # The rate and the units are attributes; without time stamps the lost samples are not seen.
    with h5py.File(folder / "attributes.h5", "w") as file:
        group = file.create_group("run 1/imu")
        group.attrs["sampling_rate"] = RATE
        group.create_dataset("gyro", data=gyro.astype(np.float32), chunks=(512, 3), compression="gzip", shuffle=True).attrs["unit"] = "rad/s"
        group.create_dataset("acc", data=accl.astype(">f8")).attrs["units"] = np.bytes_("m/s^2")
        file.create_dataset("image", data=np.zeros((4, 4, 3)))
        file.create_dataset("text", data="bench")
    truth.add("attributes.h5", both(gyro.astype(np.float32), accl))
    # A table of records, with times in ns since 1970; and a matrix of which each column is a row of the file, as MATLAB has it.
    names = [*"abcdef"]
    table = np.zeros(len(times), [("stamp", "<i8"), *((name, "<f4" if name in "abc" else "<f8") for name in names), ("flag", "u1")])
    table["stamp"] = times
    for name, values in zip(names, [*gyro.T, *accl.T]):
        table[name] = values
    with h5py.File(folder / "table.h5", "w", userblock_size=512) as file:
        file.create_dataset("log/rows", data=table, chunks=(700,), compression="gzip", fletcher32=True)
        file.create_dataset("log/matrix", data=np.c_[(times - times[0]) / 1e9, gyro].T)
    # The user block is where MATLAB writes its own header.
    with open(folder / "table.h5", "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))
    rows = ",".join(f"{channel}=log/rows.{name}" for channel, name in zip(GYRO + ACCL, names))
    truth.add("table.h5", both(gyro.astype(np.float32), accl), ["--columns", f"time=log/rows.stamp,{rows}", "--units", "rad/s,m/s^2"], kept=KEPT)
    matrix = ",".join(f"{channel}=log/matrix.{at + 1}" for at, channel in enumerate(GYRO))
    truth.add("table.h5", rates(gyro), ["--columns", f"time=log/matrix.0,{matrix}", "--units", "s,rad/s"], kept=KEPT)


def old_ardupilot(folder, truth):
    """As logs of 2014 are: the time in ms, no number of the sensor; pymavlink reads it back."""
    from pymavlink import DFReader

    times, gyro, accl = samples(23)
    millis = (times - START_NS) // 1_000_000 + 60_000
    def fmt(kind, length, name, types, labels):
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name.encode(), types.encode(), labels.encode())
    log = fmt(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
    log += fmt(10, 3 + 4 + 24, "IMU", "Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
    for time, rate, force in zip(millis, gyro, accl):
        log += bytes([0xA3, 0x95, 10]) + struct.pack("<I6f", time, *rate, *force)
    (folder / "imu_2014.bin").write_bytes(log)
    reader = DFReader.DFReader_binary(str(folder / "imu_2014.bin"))
    found = [message for message in iter(lambda: reader.recv_match(type="IMU"), None)]
    assert len(found) == len(times) and found[5].TimeMS == millis[5]
    truth.add("imu_2014.bin", both(gyro, accl), kept=KEPT)


def other_shapes(folder, truth):
    """What the same libraries write in other ways."""
    import h5py
    import pandas

    times, gyro, accl = samples(26)
    seconds = (times - times[0]) / 1e9
    units = ["--units", "rad/s,m/s^2"]
    names = ["gx", "gy", "gz", "ax", "ay", "az"]
    # Vectors in records, and halves.
    records = np.zeros(len(times), [("stamp", "<i8"), ("gyro", ">f4", (3,)), ("acc", "<f8", (3,)), ("temp", "<f2")])
    records["stamp"], records["gyro"], records["acc"] = times, gyro, accl
    np.save(folder / "vectors.npy", records)
    truth.add("vectors.npy", both(gyro.astype(np.float32), accl), units, kept=KEPT)
    # A vector in a record, integers with a factor and an offset, and one unit for each axis.
    nested = np.zeros(len(times), [("time", "f8"), ("gyro", [(axis, "f4") for axis in "xyz"]), ("name", "S8")])
    nested["time"] = seconds
    for axis, values in zip("xyz", gyro.T):
        nested["gyro"][axis] = values
    with h5py.File(folder / "nested.h5", "w") as file:
        file.create_dataset("log", data=nested)
    truth.add("nested.h5", rates(gyro.astype(np.float32)), ["--units", "rad/s"], kept=KEPT)
    counts = np.round((accl - 0.5) / 0.001).astype(np.int32)
    with h5py.File(folder / "scaled.h5", "w") as file:
        file.create_dataset("gyro", data=(gyro * 1000).astype(np.float16)).attrs["units"] = ["mrad/s"] * 3
        acc = file.create_dataset("acc", data=counts, compression="lzf")
        acc.attrs.update(units="m/s^2", scale_factor=0.001, add_offset=0.5)
        file.create_dataset("t", data=seconds)
    halves = (gyro * 1000).astype(np.float16).astype(float) / 1000
    truth.add("scaled.h5", both(halves, counts * 0.001 + 0.5), kept=KEPT)
    # Durations of pandas, and objects in lines.
    table = pandas.DataFrame(np.c_[gyro, accl], columns=names)
    table.set_index(pandas.to_timedelta(times - times[0], unit="ns")).to_csv(folder / "durations.csv")
    truth.add("durations.csv", both(gyro, accl), units, kept=KEPT)
    table.assign(timestamp=seconds).to_json(folder / "objects.jsonl", orient="records", lines=True, double_precision=12)
    truth.add("objects.jsonl", both(gyro, accl), units, kept=KEPT)
    with open(folder / "arrays.jsonl", "w") as out:
        for time, rate, force in zip(times, gyro, accl):
            print(json.dumps(dict(imu=dict(gyro=rate.tolist(), acc=force.tolist()), t=time / 1e9, id="left")), file=out)
    truth.add("arrays.jsonl", both(gyro, accl), units, kept=KEPT)
    # As a sketch prints them, with a line of its own before.
    with open(folder / "sketch.txt", "w") as out:
        print("IMU ready", file=out)
        for time, rate, force in zip(seconds, gyro, accl):
            values = ", ".join(f"{name}: {value:.9f}" for name, value in zip(names, [*rate, *force]))
            print(f"t: {time * 1e6:.0f}, {values}", file=out)
    truth.add("sketch.txt", both(gyro, accl), ["--units", "us,rad/s,m/s^2"], kept=KEPT)
    # As `write.table` of R writes them, with names that have a blank; and one column alone.
    with open(folder / "r_table.txt", "w") as out:
        print('"t" "gyro x" "gyro y" "gyro z"', file=out)
        for number, (time, rate) in enumerate(zip(seconds, gyro), start=1):
            print(f'"{number}"', f"{time:.9f}", *(f"{value:.9f}" for value in rate), file=out)
    truth.add("r_table.txt", rates(gyro), ["--units", "rad/s"], kept=KEPT)
    np.savetxt(folder / "units_in_brackets.txt", np.c_[seconds, gyro], header="t [s] gyro_x [rad/s] gyro_y [rad/s] gyro_z [rad/s]")
    truth.add("units_in_brackets.txt", rates(gyro), kept=KEPT)
    np.savetxt(folder / "one_column.txt", np.degrees(gyro[:, :1]), header="gyro_x [dps]", comments="", fmt="%.9f")
    truth.add("one_column.txt", dict(gyro_x=np.degrees(gyro[:, 0])), ["--rate", "200"])


def other_bags(folder, truth):
    """Sequences of numbers, and what ROS 2 compresses by itself."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    times, gyro, accl = samples(27)
    units = ["--units", "rad/s,m/s^2"]
    sequence = ",".join(f"{channel}=data[{at}]" for at, channel in enumerate(GYRO + ACCL))

    def write(writer, store, serialize):
        array = store.types["std_msgs/msg/Float64MultiArray"]
        layout = store.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
        with writer:
            connection = writer.add_connection("/numbers", array.__msgtype__, typestore=store)
            for time, rate, force in zip(times, gyro, accl):
                data = serialize(array(layout=layout, data=np.r_[rate, force]), array.__msgtype__)
                writer.write(connection, int(time), data)

    ros1, ros2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
    write(Writer1(folder / "sequence.bag"), ros1, ros1.serialize_ros1)
    chosen = ["--columns", f"time=record_time,{sequence}", *units]
    truth.add("sequence.bag", both(gyro, accl), chosen, kept=KEPT)
    for name, mode, ending in [("messages", CompressionMode.MESSAGE, "db3"), ("file", CompressionMode.FILE, "db3.zstd")]:
        writer = Writer2(folder / f"compressed_{name}", version=9, storage_plugin=StoragePlugin.SQLITE3)
        writer.set_compression(mode, CompressionFormat.ZSTD)
        write(writer, ros2, ros2.serialize_cdr)
        truth.add(f"compressed_{name}/compressed_{name}.{ending}", both(gyro, accl), chosen, kept=KEPT)


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    truth = Truth()
    writers = [tables, numpy_arrays, matlab, matlab_structures, hdf5, ros_bags, drawn_messages, ulog, ardupilot, old_ardupilot]
    for write in writers + [spi_captures, other_shapes, other_bags]:
        write(folder, truth)
    (folder / "truth.json").write_text(json.dumps(truth, indent=1))


if __name__ == "__main__":
    main()
