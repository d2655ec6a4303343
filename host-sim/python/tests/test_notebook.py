"""The notebook of the documentation runs, and shows what its text says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[3] / "docs" / "notebook.ipynb"


@pytest.mark.filterwarnings("ignore")  # of the kernel's own libraries
def test_the_notebook_runs_and_shows_the_report(tmp_path: Path) -> None:
    notebook: Any = nbformat.reads(NOTEBOOK.read_text(encoding="utf-8"), as_version=4)  # type: ignore[no-untyped-call]
    assert all(not cell.get("outputs") for cell in notebook.cells), "the notebook is kept without outputs"
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()
    shown: dict[str, list[str]] = {}
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            data: dict[str, Any] = output.get("data", {})
            for kind, text in data.items():
                shown.setdefault(kind, []).append(text)
    assert any("<iframe srcdoc=" in page for page in shown["text/html"])
    assert "image/svg+xml" in shown
    assert any("sinusoid" in text and "gyro_z" in text for text in shown["text/plain"])
    assert "gyroscope_noise_density" in (tmp_path / "imu.yaml").read_text(encoding="utf-8")
