"""The wheel in an environment that has nothing else: the module and the command, without Rust."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from recording import UNITS, as_csv, columns

WHEEL = os.environ.get("IMUNOISE_WHEEL")


@pytest.mark.skipif(WHEEL is None, reason="IMUNOISE_WHEEL names no wheel")
def test_the_wheel_is_all_that_is_needed(tmp_path: Path) -> None:
    assert WHEEL is not None
    environment = tmp_path / "environment"
    subprocess.run([sys.executable, "-m", "venv", environment], check=True)
    programs = environment / ("Scripts" if os.name == "nt" else "bin")
    subprocess.run([programs / "pip", "install", "--quiet", "--disable-pip-version-check", WHEEL], check=True)
    clean = {"PATH": os.devnull, "HOME": str(tmp_path)}

    def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(words, cwd=tmp_path, env=clean, capture_output=True, text=True, check=False)

    demo = run(programs / "imunoise", "demo", "--seconds", "120")
    assert demo.returncode == 0, demo.stderr
    assert "ADIS16405" in demo.stdout
    assert (tmp_path / "report.html").stat().st_size > 10_000
    recording = tmp_path / "imu.csv"
    recording.write_bytes(as_csv(columns(2_000)))
    analysed = run(programs / "imunoise", "analyze", recording, "--units", ",".join(UNITS), "-o", "report.json")
    assert analysed.returncode == 0, analysed.stderr
    code = (
        "import imunoise, json, sys; report = imunoise.analyze(sys.argv[1], units=sys.argv[2]);"
        "assert json.loads(report.to_json())['channels'] == json.load(open('report.json'))['channels']"
    )
    module = run(programs / "python", "-c", code, recording, ",".join(UNITS))
    assert module.returncode == 0, module.stderr
    refused = run(programs / "python", "-m", "imunoise", "analyze", "absent.csv")
    assert (refused.returncode, refused.stdout) == (1, "")
    assert refused.stderr.startswith("error: absent.csv")
