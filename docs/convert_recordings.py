#!/usr/bin/env python3
"""Converts the public recordings of the ADIS16405 to the CSV of register counts that imunoise reads.

    python3 docs/convert_recordings.py imudata  adis_16405_imu1.rda                    adis16405-static/run1.csv.gz
    python3 docs/convert_recordings.py launch10 logfile-1009847896.log                 adis16405-burst/launch10.csv.gz
    python3 docs/convert_recordings.py stm32    adis16405_log.txt-example              adis16405-words/stm32.csv
    python3 docs/convert_recordings.py stm32    adis16405_log.txt-example --table      stm32-table.csv
    python3 docs/convert_recordings.py --self-test

Only `imudata` needs a package besides Python 3.9: `pip install rdata`. A name that ends in .gz is written with gzip.

Where the files are (docs/measured.md has the licences):
    imudata   github.com/SMAC-Group/imudata     data/adis_16405_imu1.rda, ..._imu2.rda, ..._imu3.rda
    launch10  github.com/psas/Launch-10         data/raw/fc/logfile-1009847896.log (fc/fc/ in later revisions)
    stm32     github.com/psas/stm32             projects/flight-imu/host_fc/adis16405_log.txt-example

What is tested and what is not. `--self-test` makes a small file of each format from known counts, converts it and compares
every count. In the same way files of each format were made from the complete recordings, and converted back to the same bytes.
The first lines of the public stm32 file were compared too. The public .rda and .log files themselves were not at hand:
  * `imudata` does not rely on a unit. The values are multiples of one count; the size of a count is found in the data and
    printed, and the conversion stops if the values of a column are not multiples of it.
  * `launch10` follows fc/fc/logfile_to_csv.py of the same repository. It looks for ADIS messages and does not need to know
    the others; the byte order of the words is found by the supply, which is the first word. Which part of the log the
    figures of docs/measured.md come from could not be checked: they are of 49,425 rows over 60.6 s with the part at rest;
    `--from` and `--to` cut the converted log.
"""

import argparse
import csv
import gzip
import io
import struct
import sys
import tempfile
from pathlib import Path

CHANNELS = [
    "supply", "gyro_x", "gyro_y", "gyro_z", "accl_x", "accl_y", "accl_z",
    "magn_x", "magn_y", "magn_z", "temp", "aux_adc",
]  # order of the burst
INERTIAL = CHANNELS[1:7]


def columns(channels):
    return [f"{channel}_counts" for channel in channels]


def write(path, header, rows):
    """Writes a CSV, gzip if the name ends in .gz; returns the number of rows."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with (gzip.open(path, "wt", newline="") if path.suffix == ".gz" else open(path, "w", newline="")) as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(header)
        count = 0
        for row in rows:
            out.writerow(row)
            count += 1
    return count


def signed(word, bits):
    """The two's complement number in the lower bits of a word, with or without flags or sign above them."""
    half = 1 << (bits - 1)
    return ((word & (2 * half - 1)) ^ half) - half


# --- SMAC-Group/imudata: an R matrix of class `imu`, six columns: gyro x, y, z, accelerometer x, y, z


def step(values):
    """Size of one count in the unit of the values: the smallest difference between two of them that occurs."""
    import numpy

    distinct = numpy.unique(values)
    differences = numpy.diff(distinct)
    # Differences far below the largest value are rounding errors of a printed or converted number.
    differences = differences[differences > 1e-6 * numpy.abs(distinct).max()]
    if len(differences) == 0:
        raise SystemExit("a column holds one value only")
    rough = differences.min()
    # A multiple of it known over many counts gives it more precisely.
    counts = numpy.round((distinct - distinct[0]) / rough)
    return float(((distinct - distinct[0]) * counts).sum() / (counts * counts).sum())


def counts_of(values, name):
    """The values as counts; the zero of the unit is the zero of the counts."""
    import numpy

    size = step(values)
    counts = values / size
    rounded = numpy.round(counts)
    worst = float(numpy.abs(counts - rounded).max())
    print(f"{name}: one count is {size:.9g} in the file's unit, off by {worst:.1e} counts at most", file=sys.stderr)
    if worst > 0.05:
        raise SystemExit(f"{name} is not made of whole counts: is it compensated or filtered?")
    if numpy.abs(rounded).max() >= 1 << 13:
        raise SystemExit(f"{name} does not fit the 14 bits of the register")
    return rounded.astype(int)


def imudata(source, target):
    import numpy
    import rdata

    with open(source, "rb") as file:
        parsed = rdata.parser.parse_data(file.read())
    # The class `imu` and its attributes are R's; only the matrix is needed.
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        objects = rdata.conversion.convert(parsed)
    if len(objects) != 1:
        raise SystemExit(f"{source} holds {len(objects)} objects, not one")
    matrix = numpy.asarray(next(iter(objects.values())), dtype=float)
    if matrix.ndim != 2 or matrix.shape[1] != 6:
        raise SystemExit(f"{source} holds a table of shape {matrix.shape}, not one of six columns")
    table = numpy.column_stack([counts_of(matrix[:, i], name) for i, name in enumerate(INERTIAL)])
    return write(target, columns(INERTIAL), table.tolist())


# --- psas/Launch-10: the flight computer's log of messages


MESSAGE = struct.Struct("!4sHLH")  # four letters, nanoseconds in 48 bits, length of the body; all in network order
BODY = 24  # twelve words of the burst
# The supply is between 4.5 V and 5.5 V, 2.418 mV a count.
SUPPLY = range(1861, 2275)


def messages(log):
    """Time in ns and body of every ADIS message."""
    position = log.find(b"ADIS")
    while position >= 0 and position + MESSAGE.size + BODY <= len(log):
        _, high, low, length = MESSAGE.unpack_from(log, position)
        # The ground station's log has the length of this message the other way round.
        if length in (BODY, BODY << 8):
            start = position + MESSAGE.size
            yield high << 32 | low, log[start:start + BODY]
            position = log.find(b"ADIS", start + BODY)
        else:
            position = log.find(b"ADIS", position + 4)


def counts_of_burst(body, order):
    """The twelve words of a burst as counts: 14 bits signed, the supply, the temperature and the ADC input 12 bits."""
    supply, *words, temperature, aux_adc = struct.unpack(order + "12H", body)
    return [supply & 0xFFF, *(signed(word, 14) for word in words), signed(temperature, 12), aux_adc & 0xFFF]


def launch10(source, target, start=None, end=None):
    found = list(messages(Path(source).read_bytes()))
    if not found:
        raise SystemExit(f"{source} holds no ADIS message")
    plausible = {
        order: sum(struct.unpack_from(order + "H", body)[0] & 0x3FFF in SUPPLY for _, body in found) for order in "<>"
    }
    order = max(plausible, key=plausible.get)
    print(f"{len(found)} messages; little-endian {plausible['<']}, big-endian {plausible['>']} plausible supplies",
          file=sys.stderr)
    if plausible[order] < 0.9 * len(found):
        raise SystemExit("the supply is plausible in neither byte order")
    first = found[0][0]

    def rows():
        for time, body in found:
            seconds = (time - first) / 1e9
            if (start is None or seconds >= start) and (end is None or seconds < end):
                yield [f"{seconds:.6f}", *counts_of_burst(body, order)]

    return write(target, ["time_s", *columns(CHANNELS)], rows())


# --- psas/stm32: text lines `ADIS,timestamp,ax,ay,az,gx,gy,gz,mx,my,mz,C`, words without sign extension


WORDS = [*CHANNELS[4:7], *CHANNELS[1:4], *CHANNELS[7:10]]  # order of the line


def stm32(source, target, table=False):
    """The words as they are, for decoders; or, with `table`, sign-extended counts that `imunoise analyze` reads."""

    def lines():
        with open(source, encoding="ascii") as file:
            for line in file:
                fields = line.strip().split(",")
                if fields[0] == "ADIS" and len(fields) == 12:
                    yield fields[1:]

    if not table:
        return write(target, ["timestamp_s", *WORDS, "temp_degc_by_logger"], lines())

    def rows():
        first = None
        for time, *words, _temperature in lines():
            first = float(time) if first is None else first
            yield [f"{float(time) - first:.6f}", *(signed(int(word), 14) for word in words)]

    return write(target, ["time_s", *columns(WORDS)], rows())


# --- the test


def read(path):
    with (gzip.open(path, "rt") if str(path).endswith(".gz") else open(path)) as file:
        return list(csv.reader(file))


def self_test():
    assert [signed(word, 14) for word in (16382, 5, 0xBFFE, 0x8005, 0xFFFE)] == [-2, 5, -2, 5, -2]
    assert [signed(word, 12) for word in (0x0FFF, 71, 0x8047)] == [-1, 71, 71]
    bursts = [[2092, -4, 1, 1, 295, -1, 2, 1178, -107, -562, 71, 0], [2093, -11, 0, 8191, -8192, -2, 0, 1, 2, 3, -2048, 9]]
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for order, flags in (("<", 0), (">", 0), ("<", 0x8000)):
            log = io.BytesIO()
            for index, burst in enumerate(bursts):
                log.write(MESSAGE.pack(b"SEQN", 0, 0, 4) + struct.pack("<L", index))
                log.write(MESSAGE.pack(b"MPU9", 0, 7, 14) + bytes(14))
                words = burst if not flags else [flags | (count & 0x3FFF) for count in burst]
                time = (3 << 32) + 1_224_670 * index
                log.write(MESSAGE.pack(b"ADIS", time >> 32, time & 0xFFFFFFFF, BODY))
                log.write(struct.pack(order + ("12H" if flags else "12h"), *words))
            log.write(b"ADIS\0\0")  # a message that was cut off
            (folder / "log").write_bytes(log.getvalue())
            assert launch10(folder / "log", folder / "burst.csv.gz") == 2
            header, *rows = read(folder / "burst.csv.gz")
            assert header == ["time_s", *columns(CHANNELS)]
            assert [[int(count) for count in row[1:]] for row in rows] == bursts, (order, rows)
            assert [row[0] for row in rows] == ["0.000000", "0.001225"]
            assert launch10(folder / "log", folder / "cut.csv", start=0.001) == 1

        line = "ADIS,1369870218.048674,4,0,16084,3,10,13,16215,16147,15550,61.88"
        (folder / "text").write_text(f"# timestamp,ax,ay,az,gx,gy,gz,mx,my,mz,C\n{line}\nADIS,13698", encoding="ascii")
        assert stm32(folder / "text", folder / "words.csv") == 1
        assert read(folder / "words.csv")[1] == line.split(",")[1:]
        assert stm32(folder / "text", folder / "table.csv", table=True) == 1
        header, row = read(folder / "table.csv")
        assert header[:4] == ["time_s", "accl_x_counts", "accl_y_counts", "accl_z_counts"]
        assert row == ["0.000000", "4", "0", "-300", "3", "10", "13", "-169", "-237", "-834"]

        try:
            import numpy
            import rdata
        except ImportError:
            print("imudata not tested: pip install rdata", file=sys.stderr)
        else:
            random = numpy.random.default_rng(1)
            counts = random.integers(-40, 40, size=(1000, 6)) + numpy.array([0, 3, -2, -1, 0, -305])
            for gyro, accelerometer in ((0.05, 3.33e-3), (0.05 * numpy.pi / 180, 3.33e-3 * 9.80665), (1.0, 1.0)):
                values = counts * numpy.array([gyro] * 3 + [accelerometer] * 3)
                rdata.write_rda(folder / "run.rda", {"adis_16405_imu1": values})
                assert imudata(folder / "run.rda", folder / "run.csv.gz") == 1000
                header, *rows = read(folder / "run.csv.gz")
                assert header == columns(INERTIAL)
                assert (numpy.array(rows, dtype=int) == counts).all()
    print("self-test passed")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--self-test", action="store_true", help="convert small files of each format and compare")
    formats = parser.add_subparsers(dest="format")
    for name in ("imudata", "launch10", "stm32"):
        command = formats.add_parser(name)
        command.add_argument("source")
        command.add_argument("target")
        if name == "launch10":
            command.add_argument("--from", dest="start", type=float, help="leave out what is before, s")
            command.add_argument("--to", dest="end", type=float, help="leave out what is after, s")
        if name == "stm32":
            command.add_argument("--table", action="store_true", help="sign-extended counts that imunoise reads")
    arguments = vars(parser.parse_args())
    if arguments.pop("self_test"):
        return self_test()
    name = arguments.pop("format")
    if name is None:
        parser.error("name a format or --self-test")
    count = {"imudata": imudata, "launch10": launch10, "stm32": stm32}[name](**arguments)
    print(f"{count} rows", file=sys.stderr)


if __name__ == "__main__":
    main()
