"""Commands that do many runs and compare them: a package or a module each."""

import cvt_hpc.analysis  # noqa: F401  first: it keeps a user's settings out of matplotlib
