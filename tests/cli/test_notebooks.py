"""The notebooks run where Jupyter runs them, from top to bottom, and show their pictures: with shorter runs.

All have one process of Python, in which each finds no names of the others.
"""

import re
from pathlib import Path

import nbformat
import pytest
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from nbclient.util import run_sync

FOLDER = Path(__file__).parents[2] / "jobs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SHORTER = {
    '"run": {"duration": "0.3 s"}': '"run": {"duration": "0.1 s"}, "mesh": {"stations": 64}',
    'load_job("../lebrecht_2004.toml")': 'load_job("../lebrecht_2004.toml", ["duration=0.12", "longest_duration=0.12", "stations=64"])',
    "np.linspace(0.02, 0.08, 13)": "np.linspace(0.02, 0.08, 5)",
    "[-1.6, -1.2, -0.8]": "[-1.6, -0.8]",
    "np.linspace(20, 160, 8)": "np.linspace(20, 160, 3)",
}
SOURCES = "".join(cell.source for path in NOTEBOOKS for cell in nbformat.read(path, as_version=4).cells)
assert all(said in SOURCES for said in SHORTER)
PICTURE = re.compile(r"\w+\.cvt\.(map|waterfall|history|spectrogram|phase|energy|onset_bands|sensitivity)\(")


def test_there_are_notebooks():
    assert len(NOTEBOOKS) == 6


@pytest.fixture(scope="module")
def kernel(tmp_path_factory):
    """What runs the cells; the first notebook starts it."""
    folder = str(tmp_path_factory.mktemp("jupyter"))
    with pytest.MonkeyPatch.context() as patch:
        for name in ("JUPYTER_RUNTIME_DIR", "JUPYTER_DATA_DIR", "IPYTHONDIR"):
            patch.setenv(name, folder)
        kernel = AsyncKernelManager(kernel_name="python3")
        yield kernel
        run_sync(kernel.shutdown_kernel)(now=True)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_its_pictures(path, kernel):
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.insert(0, nbformat.v4.new_code_cell("%reset -f"))
    for cell in notebook.cells:
        for said, shorter in SHORTER.items():
            cell.source = cell.source.replace(said, shorter)
    NotebookClient(notebook, kernel, timeout=600, resources={"metadata": {"path": str(FOLDER)}}).execute()
    for cell in notebook.cells:
        if cell.cell_type == "code" and PICTURE.match(cell.source.splitlines()[-1]):
            assert any("image/png" in output.get("data", {}) for output in cell.outputs), cell.source


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_keeps_no_output(path):
    cells = nbformat.read(path, as_version=4).cells
    assert all(not cell.get("outputs") and not cell.get("execution_count") for cell in cells)
    assert cells[0].source.startswith("# ")
