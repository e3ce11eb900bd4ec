"""Jobs, notebooks and batch files that come with the program, to be copied and changed."""

import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path, PurePosixPath

import cvt_hpc
from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.files import written_aside
from cvt_hpc.tables import columns

_SHARE = "share/cvt_hpc/"  # where an installed package has them
_QUOTED = re.compile(r"\"([\w./-]+)\\?\"")  # in notebooks the marks are escaped


def example_files() -> dict[str, Path]:
    """Return the examples by their names, such as "jobs/quickstart.toml".

    Those of an installed package are among its files; those of a checkout are where its pyproject.toml lists
    them.

    Raises
    ------
    InputError
        If there are none.
    """
    root = Path(cvt_hpc.__file__).parents[1]
    if (settings := root / "pyproject.toml").is_file():
        kept = tomllib.loads(settings.read_text("utf-8"))["tool"]["setuptools"]["data-files"]
        patterns = [pattern for listed in kept.values() for pattern in listed]
        paths = {path for pattern in patterns for path in root.glob(pattern) if path.is_file()}
        files = {path.relative_to(root).as_posix(): path for path in paths}
    else:
        installed = {file.as_posix().partition(_SHARE)[2]: file for file in metadata.files("cvt_hpc") or ()}
        files = {
            name: Path(str(file.locate()))
            for name, file in installed.items()
            if name and file.suffix != ".pyc"
        }
    if not files:
        raise mismatch("examples", f"those of a wheel, or of a checkout in {root}", "none")
    return dict(sorted(files.items()))


def example_lines() -> Iterator[str]:
    """Yield a line for each example that somebody runs: its name, and what it is about."""
    shown = {name: path for name, path in example_files().items() if path.suffix not in (".csv", ".nc")}
    yield from columns([(name, _subject(path)) for name, path in shown.items()], indent="")


def copy_examples(names: Sequence[str], out: Path) -> list[Path]:
    """Copy examples, with the files that they read, to their places below a folder.

    Parameters
    ----------
    names : sequence of str
        Each a name as of `example_files`, a folder, or the last part of either, with or without its suffix.
    out : Path
        The folder; it is made if needed.

    Returns
    -------
    list of Path
        The copies.

    Raises
    ------
    InputError
        If there is no such example, a copy would replace a file, or the system refuses.
    """
    known = example_files()
    chosen = dict.fromkeys(name for word in names for name in _named(word, known))
    chosen |= dict.fromkeys(other for name in chosen for other in _read_by(name, known))
    copies = {name: out / name for name in chosen}
    for path in copies.values():
        if os.path.lexists(path):
            raise mismatch(str(path), "a place that is free", "a file", "choose another folder by --out")
    for name, path in copies.items():
        with written_aside(path, parents=True) as aside:
            aside.write_bytes(known[name].read_bytes())
    return list(copies.values())


def _named(word: str, known: Mapping[str, Path]) -> list[str]:
    """Names of the examples that a word means."""
    word = word.rstrip("/")
    found = [
        name
        for name in known
        for place in [PurePosixPath(name)]
        if word in (name, place.name, place.stem, str(place.with_suffix("")))
        or any(word in (str(folder), folder.name) for folder in list(place.parents)[:-1])
    ]
    if not found:
        stems = dict.fromkeys(PurePosixPath(name).stem for name in known)
        raise unknown(f"examples: {word}", "example", word, stems, "`cvt-hpc examples` lists them")
    return found


def _read_by(name: str, known: Mapping[str, Path]) -> Iterator[str]:
    """Names of the other examples that a job or a notebook reads."""
    if known[name].suffix not in (".toml", ".ipynb"):
        return
    for word in _QUOTED.findall(known[name].read_text()):
        other = os.path.normpath(PurePosixPath(name).parent / word)
        if other in known:
            yield other


def _subject(path: Path) -> str:
    """What an example is about, by the first sentence of its first line."""
    text = path.read_text()
    if path.suffix == ".toml":
        return str(tomllib.loads(text).get("description", ""))
    if path.suffix == ".ipynb":
        text = "".join(json.loads(text)["cells"][0]["source"])
    lines = (line.strip('#" \n') for line in text.splitlines() if not line.startswith("#!"))
    return next(filter(None, lines), "").partition(". ")[0]
