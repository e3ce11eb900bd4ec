"""Every kind of picture by the command line: on one page, no text on another or cut, lines told apart by all."""

import re
from itertools import combinations

import numpy as np
import pytest
from matplotlib.text import Text

from cvt_hpc.analysis.figures import LONG, NARROW
from cvt_hpc.cli import main
from cvt_hpc.storage.netcdf import write_history
from support import pictured
from support.eyes import EYES, lightness, seen

RAW = re.compile(
    "|".join(
        {
            str(name)
            for whole in (pictured.results(), pictured.ramps(), pictured.history())
            for name in whole.variables
            if "_" in str(name)
        }
    )
)  # names as datasets have them, which stand in no picture
MARGIN = 0.01  # [inch]
IN_GREY, IN_COLOUR = 15.0, 10.0  # differences that an eye sees without looking twice
KINDS = {
    "map": "map R",
    "map with measurements": "map R --at ratio=1 --measured M",
    "maps": "map R R2",
    "map of values": "map R --show efficiency --show amplitude --panel ratio",
    "waterfall": "plot waterfall R",
    "waterfall of panels": "plot waterfall R --x driving_speed --panel ratio --vmax 5um",
    "waterfall with measurements": "plot waterfall R --panel ratio --measured M",
    "campbell": "plot campbell R",
    "campbell of panels": "plot campbell R --panel ratio --orders 1 2 3 8 16 24 --vmax 5um",
    "hysteresis": "plot hysteresis S",
    "curves of values": "plot curve R efficiency amplitude --at ratio=1 --lines driving_speed",
    "strands": "plot strands R --at driving_speed=100rad/s",
    "strands of panels": "plot strands R --at driving_speed=100rad/s --x load --panel ratio",
    "wrap": "plot wrap H H2",
    "profile": "plot profile H H2",
    "profile of a wrap": "plot profile H H2 --of sliding --region driven --columns load",
    "ramp": "plot ramp L --vmax 5um",
    "ramp with measurements": "plot ramp L --measured M",
    "orders": "plot orders V --of t2 --velocity --level",
    "orders of two": "plot orders H V --orders 1 2 4 8",
    "order cuts": "plot order_cuts R --at load=100",
    "third octaves": "plot third_octaves H",
    "third octaves of several": "plot third_octaves H H2 --of t1 --of load --of driving_speed",
    "spectrograms": "plot spectrogram H L V --vmax 5um",
    "element of an arc": "plot element H --region driven",
    "history": "plot history H",
    "phase": "plot phase H",
    "flanks": "plot flanks H",
    "energy": "plot energy H",
    "variator": "plot variator H",
    "variator of both signs": "plot variator H --of sliding --of push_force",
}


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """Files by the letter that stands for them in KINDS."""
    folder = tmp_path_factory.mktemp("stored")
    files = {"R": folder / "results.nc", "R2": folder / "other.nc", "S": folder / "ramps.nc"}
    pictured.results().to_netcdf(files["R"])
    pictured.results().assign_attrs(job_name="other pictures").to_netcdf(files["R2"])
    pictured.ramps().to_netcdf(files["S"])
    files["M"] = folder / "a_long_name_of_a_file_of_the_rig_and_its_day.csv"
    heads = (f"{name}_{end}" for name in ("load", "measured_load") for end in ("from [N m]", "to [N m]"))
    files["M"].write_text(f"{','.join(heads)}\n60,150,20,180\n")
    histories = {"H": {}, "H2": {"load": 80.0}, "L": {"ramped": "load"}, "V": {"ramped": "driving_speed"}}
    for letter, options in histories.items():
        files[letter] = write_history(pictured.history(**options), folder / f"run_{letter}.nc")
    return files


@pytest.fixture
def drawn(stored, monkeypatch, capsys):
    """Return a function that draws a picture by a command line with such letters, and returns its figure."""
    figures = []
    keep = lambda figure, out: figures.append(figure) or out  # noqa: E731
    monkeypatch.setattr("cvt_hpc.analysis.figures.save_figure", keep)

    def draw(line):
        words = [str(stored.get(word, word)) for word in line.split()]
        assert main(words) == 0, capsys.readouterr().err
        return figures[-1]

    return draw


def assert_on_a_page(figure):
    size = sorted(figure.get_size_inches())
    assert size[0] <= NARROW + MARGIN and size[1] <= LONG + MARGIN, size


@pytest.mark.parametrize("line", KINDS.values(), ids=KINDS)
def test_a_picture_is_one_page_with_texts_that_are_whole_and_apart(line, drawn, monkeypatch):
    figure = drawn(line)
    assert_on_a_page(figure)
    assert pictured.faults_of(figure, monkeypatch) == []
    assert not [text.get_text() for text in figure.findobj(Text) if RAW.search(text.get_text())]
    for axes in figure.axes:
        assert_lines_apart([line for line in axes.lines if not line.get_label().startswith("_")])


def assert_lines_apart(lines):
    """Lines with labels of their own differ in more than a colour that not all see, or that a copier drops."""
    for one, other in combinations(lines, 2):
        looks = [(line.get_linestyle(), line.get_marker(), line.get_fillstyle()) for line in (one, other)]
        if one.get_label() == other.get_label() or looks[0] != looks[1]:
            continue
        colours = [line.get_color() for line in (one, other)]
        assert abs(np.subtract(*lightness(colours))) > IN_GREY, (one, other)
        for eyes in EYES:
            assert np.linalg.norm(np.subtract(*seen(colours, eyes))) > IN_COLOUR, (one, other, eyes)
