"""The type stubs are complete and true."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def run(*arguments: str) -> None:
    done = subprocess.run([sys.executable, "-m", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_package_and_tests_pass_mypy_strict() -> None:
    run("mypy", "--strict", "package", "tests")


def test_the_stub_is_what_the_compiled_half_has() -> None:
    run("mypy.stubtest", "imunoise", "--concise", "--mypy-config-file", "pyproject.toml")
