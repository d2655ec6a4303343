"""Writes a table of register counts of six inertial channels: white noise, flicker noise, a random walk and a line."""

import sys

import numpy

rows, file = int(float(sys.argv[1])), sys.argv[2]
CHUNK = 1_000_000
random = numpy.random.default_rng(16405)
names = [f"{kind}_{axis}_counts" for kind in ("gyro", "accl") for axis in "xyz"]
with open(file, "w") as table:
    table.write(",".join(names) + "\n")
    walk = numpy.zeros(6)
    for first in range(0, rows, CHUNK):
        count = min(CHUNK, rows - first)
        walks = walk + numpy.cumsum(random.normal(scale=0.002, size=(count, 6)), axis=0)
        walk = walks[-1]
        line = 2.0 * numpy.sin(2.0 * numpy.pi * 20.5 / 100.0 * (first + numpy.arange(count)))[:, None]
        counts = random.normal(scale=8.0, size=(count, 6)) + walks + line
        numpy.savetxt(table, numpy.rint(counts), fmt="%d", delimiter=",")
