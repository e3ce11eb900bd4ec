"""The figures that jobs reproduce: how each is drawn and what the paper says of it."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from cvt_hpc.analysis.arcs import sliding_figure, spiral_figure
from cvt_hpc.analysis.curves import curve_figure
from cvt_hpc.analysis.energy_blocks import blocks_figure, friction_figure, spectrum_figure, strand_bars_figure
from cvt_hpc.analysis.figures import draw
from cvt_hpc.analysis.followed_drawing import element_figure
from cvt_hpc.analysis.profiles import profile_figure
from cvt_hpc.analysis.ramps import course_figure, ramp_figure
from cvt_hpc.analysis.statements import (
    bullinger_along,
    bullinger_ratios,
    lebrecht_belt,
    lebrecht_excitation,
    lebrecht_ramps,
)
from cvt_hpc.analysis.statements.verdicts import Finding, Kept, Statement, judged, opened
from cvt_hpc.analysis.waterfall import waterfall_figure
from cvt_hpc.errors import unknown
from cvt_hpc.files import write_rows
from cvt_hpc.provenance import origin_lines

SLIDING = ("radial_sliding", "sliding_speed")
COLUMNS = ("figure", "statement", "verdict", "measured", "why")


class PaperFigure(NamedTuple):
    """A figure of a paper.

    Attributes
    ----------
    source : str
        Paper and number.
    compose : callable
        Draws it of a study.
    statements : sequence of Statement
        What the paper says of it.
    """

    source: str
    compose: Callable[[Kept], Figure]
    statements: Sequence[Statement]


def _along(
    *quantities: str, region: str | None = None, columns: str | None = None
) -> Callable[[Kept], Figure]:
    """Quantities along the belt, of all histories."""
    return lambda kept: profile_figure(kept.histories, quantities, region, columns)


FIGURES = {
    f"bullinger_{number}": PaperFigure(f"Bullinger et al. 2005, fig. {int(number)}", compose, statements)
    for number, compose, statements in (
        ("04", lambda kept: sliding_figure(kept.histories), bullinger_along.FIGURE_4),
        ("05", lambda kept: strand_bars_figure(kept.results), bullinger_ratios.FIGURE_5),
        ("20", _along("push_force", "friction_force", "ring_friction"), bullinger_along.FIGURE_20),
        ("21", _along("mean_displacement", "sliding_angle"), bullinger_along.FIGURE_21),
        ("22", _along("push_force", "sliding_angle", columns="ratio"), bullinger_ratios.FIGURE_22),
        ("23", _along("normal_force", region="driving"), bullinger_ratios.FIGURE_23),
    )
}
FIGURES |= {
    f"lebrecht_{number.replace('.', '_')}": PaperFigure(
        f"Lebrecht et al. 2004, fig. {number}", compose, statements
    )
    for number, compose, statements in (
        ("3.1", lambda kept: course_figure(kept.histories[0], "driving_moment"), lebrecht_ramps.FIGURE_3_1),
        ("3.2", lambda kept: waterfall_figure(kept.results), lebrecht_belt.FIGURE_3_2),
        ("3.6", lambda kept: strand_bars_figure(kept.results), lebrecht_belt.FIGURE_3_6),
        ("3.7", lambda kept: curve_figure(kept.results, ["eigenfrequency"]), lebrecht_belt.FIGURE_3_7),
        ("3.9", lambda kept: ramp_figure(kept.histories), lebrecht_ramps.FIGURE_3_9),
        ("3.10", lebrecht_belt.swings_figure, lebrecht_belt.FIGURE_3_10),
        ("3.11", lambda kept: spectrum_figure(kept.run()), lebrecht_belt.FIGURE_3_11),
        ("3.12", lambda kept: friction_figure(kept.results), lebrecht_excitation.FIGURE_3_12),
        ("3.13", lambda kept: ramp_figure(kept.histories), lebrecht_ramps.FIGURE_3_13),
        ("3.14", lambda kept: ramp_figure(kept.histories), lebrecht_ramps.FIGURE_3_14),
        ("4.1", lambda kept: spiral_figure(kept.histories[0], "driven"), lebrecht_excitation.FIGURE_4_1),
        (
            "4.2",
            lambda kept: element_figure(kept.histories[0], "driven", parts=SLIDING),
            lebrecht_excitation.FIGURE_4_2,
        ),
        ("4.4", lambda kept: blocks_figure(kept.histories), lebrecht_excitation.FIGURE_4_4),
    )
}


def figure_of(folder: Path) -> tuple[Path, Path, list[Finding]]:
    """Draw the figure of a study and measure what its paper says of it.

    Parameters
    ----------
    folder : Path
        Output folder of one of the jobs of FIGURES.

    Returns
    -------
    picture, table : Path
        figure.png and statements.csv in the folder.
    findings : list of Finding
        In the paper's order.

    Raises
    ------
    InputError
        The folder is not that of such a job, or holds no results.
    """
    with opened(folder) as kept:
        name = str(kept.results.attrs.get("job_name", ""))
        if name not in FIGURES:
            raise unknown(f"{folder}: job {name}", "job of a paper's figure", name, list(FIGURES))
        figure = FIGURES[name]
        picture = draw(lambda: figure.compose(kept), folder / "figure.png")
        findings = [judged(statement, kept) for statement in figure.statements]
        origin = list(origin_lines(kept.results.attrs))
    rows = [(figure.source, one.text, one.verdict.value, one.numbers, one.why) for one in findings]
    table = write_rows(folder / "statements.csv", COLUMNS, rows, origin)
    return picture, table, findings


def finding_lines(findings: Sequence[Finding]) -> Iterator[str]:
    """Yield a line for each finding, and one that counts them."""
    for finding in findings:
        yield f"{finding.verdict.value}: {finding.text}"
        yield f"    {finding.numbers}" + (f"; {finding.why}" if finding.why else "")
    counts = {
        verdict: sum(f.verdict is verdict for f in findings)
        for verdict in dict.fromkeys(f.verdict for f in findings)
    }
    yield f"{len(findings)} statements: {', '.join(f'{n} {verdict.value}' for verdict, n in counts.items())}"
