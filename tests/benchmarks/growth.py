"""Growth and frequency of the leading mode, linear against transient: see docs/guide/results_stability.md.

python tests/benchmarks/growth.py 60 90 110 125 140
python tests/benchmarks/growth.py 60 80 --set friction_memory=1e-4 --size 1e-9
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from cvt_hpc.models.elastic_belt import PARAMETERS
from cvt_hpc.models.elastic_belt.belt import mesh
from cvt_hpc.models.linear_stability.branch import branch
from cvt_hpc.models.steady_variator.walking import SteadyBelt
from support.growing import measured


def main() -> None:
    """Print a row for each load."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("loads", nargs="+", type=float, help="[N m]")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=NUMBER", help="parameter [SI]")
    parser.add_argument("--size", type=float, default=1e-10, help="largest displacement at the start [m]")
    parser.add_argument("--step", type=float, default=1e-6, help="time step [s]")
    arguments = parser.parse_args()
    p = {key: parameter.default for section in PARAMETERS.values() for key, parameter in section.items()}
    for key, value in (assignment.split("=") for assignment in arguments.set):
        p[key] = type(p[key])(float(value))
    print("load [N m]  linear [1/s] [Hz]   transient [1/s] [Hz]")
    for point in branch(SteadyBelt(p), mesh(p), arguments.loads).points:
        mode, (growth, frequency) = point.modes[0], measured(point, arguments.size, arguments.step)
        expected = f"{mode.growth:9.1f} {mode.frequency:8.1f}"
        print(f"{point.steady.load:10.6g}  {expected}   {growth:9.1f} {frequency:8.1f}", flush=True)


if __name__ == "__main__":
    main()
