"""`python -m cvt_hpc` is `cvt-hpc`."""

import sys

from cvt_hpc.cli import main

sys.exit(main())
