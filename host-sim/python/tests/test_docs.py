"""The code of the documentation runs and prints what the documentation says."""

from __future__ import annotations

import contextlib
import doctest
import io
import re
from pathlib import Path
from typing import Any

import imunoise
import pytest

ROOT = Path(__file__).parents[3]


def test_the_page_prints_what_it_says() -> None:
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", page, re.DOTALL)
    assert len(blocks) == page.count("```python") == 7
    names: dict[str, Any] = {}
    for code, output in blocks:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(code, names)
        assert printed.getvalue() == output, code


def test_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    readme = (ROOT / "host-sim" / "python" / "README.md").read_text(encoding="utf-8")
    [code] = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
    exec(code, {})
    assert "20,000 samples" in capsys.readouterr().out


def test_the_docstrings_run() -> None:
    failed, tried = doctest.testmod(imunoise)
    assert (failed, tried) == (0, 5)
