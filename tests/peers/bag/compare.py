"""Runs this program and its peers on one bag and prints the table of docs/peers.md: compare.py IMUNOISE FOLDER SECONDS.

Each works in a process of its own, whose processor time and memory are printed. The Python peers read no bags: theirs include the
reading with rosbags, which is done once. allan_variance_ros takes part if ALLAN_VARIANCE_ROS is a folder with the built `allan_variance`
and its `scripts`; it needs the programs of ROS 1, of which `rosmaster` is started here.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

from peer import AXES, PEERS, printed_coefficients
from write import LINE, RATE_HZ, TRUTH

HERE = Path(__file__).parent
TERMS = ("angle_random_walk", "bias_instability", "rate_random_walk")


def run(*command, cwd=None):
    """The standard output of a command, its processor time in s and its largest memory in MB."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=cwd)
    printed = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{command[0]} ended with status {status}")
    return printed, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def cell(value, low=None, high=None):
    if value is None:
        return "–"
    return f"{value:.4g}" + (f" ({low:.4g} to {high:.4g})" if high is not None else "")


def row(name, seconds, memory, axes):
    coefficients = [cell(*value) if isinstance(value, list) else cell(value) for axis in axes for value in axis]
    print("|", " | ".join([name, f"{seconds:.1f} s", f"{memory:.0f} MB", *coefficients]), "|", flush=True)


def ours(imunoise, bag, folder):
    """The coefficients that `analyze` states with their 95 % bounds, and the names of what it finds besides."""
    file = folder / "report.json"
    _, seconds, memory = run(imunoise, "analyze", str(bag), "-o", str(file), "--force", "--quiet")
    report = json.loads(file.read_text())
    axes = []
    for at in AXES:
        terms = {term["kind"]: term["parameters"] for term in report["channels"][at]["final"]["terms"]}
        axes.append([[terms[kind]["value"][key] for key in ("value", "low", "high")] for kind in TERMS])
    found = [f"{of['kind']} in {', '.join(of['channels'])}: {parameters(of)}" for of in report["findings"]]
    return axes, found, seconds, memory


def parameters(finding):
    return ", ".join(f"{name} {cell(of['value'], of['low'], of['high'])} {of['unit']}" for name, of in finding["parameters"].items())


def ros(program, bag, folder):
    """The procedure of its README: curves by the C++ program, coefficients by its script."""
    config = folder / "ros.yaml"
    config.write_text(f"imu_topic: /imu\nimu_rate: {RATE_HZ:.0f}\nmeasure_rate: {RATE_HZ:.0f}\nsequence_time: 100000\n")
    os.environ.update(ROS_MASTER_URI="http://localhost:11311", MPLBACKEND="Agg")
    master = subprocess.Popen(["rosmaster", "--core"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        time.sleep(3)  # until it listens
        _, curves, memory = run(str(program / "allan_variance"), str(bag.parent), str(config))
    finally:
        master.terminate()
    script = str(program / "scripts" / "analysis.py")
    table = str(bag.parent / "allan_variance.csv")
    printed, fit, _ = run(sys.executable, script, "--data", table, "--config", str(config), cwd=folder)
    return printed_coefficients(printed), curves + fit, memory


def main():
    imunoise, folder, length = sys.argv[1], Path(sys.argv[2]).resolve(), sys.argv[3]
    bag, table = folder / "bag" / "imu.bag", folder / "imu.npy"
    if not bag.exists():
        bag.parent.mkdir(parents=True, exist_ok=True)
        run(sys.executable, str(HERE / "write.py"), str(bag), length)

    frequency, amplitude = LINE
    print(f"{float(length) * RATE_HZ:.0f} messages, {bag.stat().st_size / 1e6:.0f} MB; gyro z has a line of {amplitude} deg/s at {frequency} Hz")
    print("| | processor time | memory | x: N | B | K | z: N | B | K |")
    print("|---|---|---|---|---|---|---|---|---|")
    print("| truth | | |", " | ".join(map(cell, TRUTH["gyro"] * len(AXES))), "|")
    coefficients, found, seconds, memory = ours(imunoise, bag, folder)
    row("imunoise analyze", seconds, memory, coefficients)
    if "ALLAN_VARIANCE_ROS" in os.environ:
        coefficients, seconds, memory = ros(Path(os.environ["ALLAN_VARIANCE_ROS"]).resolve(), bag, folder)
        row("allan_variance_ros", seconds, memory, coefficients)
    _, reading, most = run(sys.executable, str(HERE / "peer.py"), "read", str(bag), str(table))
    for name in PEERS:
        printed, seconds, memory = run(sys.executable, str(HERE / "peer.py"), name, str(table), str(folder / "peer"))
        row(f"{name}, {reading:.1f} s of it for reading", reading + seconds, max(most, memory), json.loads(printed.splitlines()[-1]))
    print("imunoise finds besides:", "; ".join(found) or "nothing")


main()
