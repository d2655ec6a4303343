"""Computes the overlapping Allan deviation of every column of a table at octaves with pandas and allantools, as a user's script does."""

import sys

import allantools
import pandas

table = pandas.read_csv(sys.argv[1])
rate = float(sys.argv[2])
for name in table.columns:
    allantools.oadev(table[name].to_numpy(float), rate=rate, data_type="freq", taus="octave")
