"""What `outcome_lines` takes, of a dataset."""

from cvt_hpc.variables import Outcome


def outcomes_of(dataset):
    """Return what the dataset of a run has without a dimension or along one."""
    return [
        Outcome(str(name), one.values, one.dims, one.attrs, one[one.dims[0]].values if one.ndim else ())
        for name, one in dataset.data_vars.items()
        if one.ndim <= 1
    ]
