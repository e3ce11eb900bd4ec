"""Puts the examples of pyproject.toml, [tool.cvt_hpc], into the wheel; all else stands there too."""

import shutil
import tomllib
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).parent


class BuildWithExamples(build_py):
    """Copies the examples into the package; an editable install reads them where they are."""

    def run(self):
        """Build as without them, and copy."""
        super().run()
        if self.editable_mode:
            return
        settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
        examples = Path(self.build_lib) / "cvt_hpc" / "examples"
        shutil.rmtree(examples, ignore_errors=True)
        for pattern in settings["tool"]["cvt_hpc"]["examples"]:
            for file in ROOT.glob(pattern):
                target = examples / file.relative_to(ROOT)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(file, target)


setup(cmdclass={"build_py": BuildWithExamples})
