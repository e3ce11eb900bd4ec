"""Sobol indices of a quantity to uncertain parameters: indices.py OUT/STUDY TABLE.csv QUANTITY."""

import sys

from cvt_hpc import open_results
from cvt_hpc.errors import InputError
from cvt_hpc.storage.provenance import origin_lines

if __name__ == "__main__":
    folder, table, quantity = sys.argv[1:]
    try:
        with open_results(folder) as results:
            found = results.load().cvt.indices(quantity)
    except InputError as error:
        sys.exit(f"indices.py: {error}")
    with open(table, "w", encoding="utf-8") as out:
        out.writelines(origin_lines(results.attrs))
        found.to_dataframe().to_csv(out, float_format="%.4g", lineterminator="\n")
