"""Counts the package, at one revision or several: code, imports, public names, long files and `Any`.

    python3 tests/size.py [REVISION ...]        # of git; without any: the files as they lie there

Code are lines with a token that is no comment and stand in no docstring. Imports are those of them in import
statements. Public names are functions, classes and variables at the top level of a module that do not begin with _.
`Any` counts lines that name it outside imports. Long are files of more than 400 lines.
"""

import ast
import io
import subprocess
import sys
import tokenize
from pathlib import Path

ROOT = Path(__file__).parents[1]
NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}
DOCUMENTED = ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef
COUNTS = "code", "imports", "public names", "lines with Any", "long files", "lines"


def sources(revision):
    """Texts of the package's modules."""
    if not revision:
        return [path.read_text() for path in sorted(ROOT.glob("cvt_hpc/**/*.py"))]

    def git(*words):
        return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout

    names = git("ls-tree", "-r", "--name-only", revision, "cvt_hpc").split()
    return [git("show", f"{revision}:{name}") for name in names if name.endswith(".py")]


def lines_of(node):
    """Numbers of the lines that a statement takes."""
    return set(range(node.lineno, node.end_lineno + 1))


def names_of(node):
    """Names that a statement at the top level defines."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = {ast.Assign: lambda: node.targets, ast.AnnAssign: lambda: [node.target]}.get(type(node), list)()
    return [target.id for target in targets if isinstance(target, ast.Name)]


def counts(text):
    """COUNTS of a module."""
    tree = ast.parse(text)
    nodes = list(ast.walk(tree))
    strings = [node.body[0] for node in nodes if isinstance(node, DOCUMENTED) and ast.get_docstring(node)]
    documented = set().union(*map(lines_of, strings))
    importing = set().union(
        *(lines_of(node) for node in nodes if isinstance(node, ast.Import | ast.ImportFrom))
    )
    tokens = [
        token for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type not in NO_CODE
    ]
    code = {line for token in tokens for line in range(token.start[0], token.end[0] + 1)} - documented
    anything = {token.start[0] for token in tokens if token.string == "Any"} - importing
    public = [name for node in tree.body for name in names_of(node) if not name.startswith("_")]
    lines = text.count("\n")
    return len(code), len(code & importing), len(public), len(anything), int(lines > 400), lines


def main():
    """A line for each revision."""
    print("revision", *COUNTS, sep=", ")
    for revision in sys.argv[1:] or [""]:
        total = [sum(column) for column in zip(*map(counts, sources(revision)), strict=True)]
        print(
            revision or "as it lies",
            *total,
            f"imports are {100 * total[1] / total[0]:.1f} % of the code",
            sep=", ",
        )


if __name__ == "__main__":
    main()
