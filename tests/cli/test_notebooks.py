"""The notebooks run where Jupyter runs them, from top to bottom, and show their pictures: with shorter runs."""

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[2] / "jobs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SHORTER = {
    '"run": {"duration": "0.3 s"}': '"run": {"duration": "0.1 s"}, "mesh": {"stations": 64}',
    'load_job("../lebrecht_2004.toml")': 'load_job("../lebrecht_2004.toml", ["duration=0.12", "longest_duration=0.12", "stations=64"])',
}
SOURCES = "".join(cell.source for path in NOTEBOOKS for cell in nbformat.read(path, as_version=4).cells)
assert all(said in SOURCES for said in SHORTER)
PICTURE = re.compile(r"\w+\.cvt\.(map|waterfall|history|spectrogram|phase|energy)\(")


def test_there_are_notebooks():
    assert len(NOTEBOOKS) == 5


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_its_pictures(path, tmp_path, monkeypatch):
    for name in ("JUPYTER_RUNTIME_DIR", "JUPYTER_DATA_DIR", "IPYTHONDIR"):
        monkeypatch.setenv(name, str(tmp_path))
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        for said, shorter in SHORTER.items():
            cell.source = cell.source.replace(said, shorter)
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(FOLDER)}}).execute()
    for cell in notebook.cells:
        if cell.cell_type == "code" and PICTURE.match(cell.source.splitlines()[-1]):
            assert any("image/png" in output.get("data", {}) for output in cell.outputs), cell.source


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_keeps_no_output(path):
    cells = nbformat.read(path, as_version=4).cells
    assert all(not cell.get("outputs") and not cell.get("execution_count") for cell in cells)
    assert cells[0].source.startswith("# ")
