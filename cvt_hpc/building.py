"""The build of a wheel, as pyproject.toml names it: the revision of the sources goes with them."""

import subprocess
from contextlib import suppress
from pathlib import Path

from setuptools.command.build_py import build_py


class WithRevision(build_py):
    """Copy the package, and write the revision of the checkout into the copy of cvt_hpc/revision.txt."""

    def run(self) -> None:
        """Copy the package; sources of which git does not keep pyproject.toml leave the file as it is."""
        super().run()
        if self.editable_mode:
            return
        kept = ["git", "ls-files", "--error-unmatch", "pyproject.toml"]
        describe = ["git", "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
        with suppress(OSError, subprocess.SubprocessError):
            subprocess.run(kept, check=True, capture_output=True)
            found = subprocess.run(describe, check=True, capture_output=True, text=True).stdout
            (Path(self.build_lib) / "cvt_hpc" / "revision.txt").write_text(found, encoding="utf-8")
