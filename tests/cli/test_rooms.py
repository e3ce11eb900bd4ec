"""What the guide says of the rooms of the package, against the package itself."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

import cvt_hpc
from cvt_hpc.models import MODELS

PACKAGE = Path(cvt_hpc.__file__).parent
BUILT = (PACKAGE.parent / "docs" / "guide" / "structure.md").read_text()
SOURCES = sorted(PACKAGE.rglob("*.py"))
FILES = {
    ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): path
    for path in SOURCES
}


def room(path):
    """The folder of a module, or its own name where it lies above all rooms."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def statements(block):
    """Those of a block, and within them; without their expressions, which are most of a file and import nothing."""
    for node in block:
        yield node
        for inner in ("body", "orelse", "finalbody", "handlers", "cases"):
            yield from statements(getattr(node, inner, ()))


def by_module(path):
    """Names of `cvt_hpc.storage.files` that a file uses by that module's name."""
    return {f"cvt_hpc.storage.files.{name}" for name in re.findall(r"\bfiles\.(\w+)", path.read_text())}


@cache
def tree(path):
    """Syntax of a file."""
    return ast.parse(path.read_text())


@cache
def imported(path):
    """Modules that a file names in its imports; a module of a package is imported without the package's own names."""
    names = set()
    for node in statements(tree(path).body):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            taken = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= taken if taken <= set(FILES) else {node.module, *taken}
    return names


def test_the_tree_names_all_that_is_there():
    lines = BUILT.split("\ncvt_hpc/\n")[1].split("\nslurm/")[0].splitlines()
    names = " ".join(re.split(r"\s{2,}", line.strip())[0] for line in lines)
    named = set(re.findall(r"[a-z_]+(?:/|[.]py\b|[.]typed|[.]txt)", names))
    found = {
        f"{path.name}/" if path.is_dir() else path.name for path in PACKAGE.iterdir() if path.name[0] != "_"
    }
    assert named == found


def test_imports_run_downwards():
    chain = re.search(r"downwards only: ([^.]*)[.]", BUILT)[1]
    levels = [level.replace(",", " ").split() for level in chain.split("->")]
    height = {name: -depth for depth, names in enumerate(levels) for name in names}
    folders = {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name[0] != "_"}
    assert folders | {"cli"} == set(height)
    for path in SOURCES:
        for module in imported(path):
            below = module.split(".")[1] if module.startswith("cvt_hpc.") else ""
            if below in height and room(path) in height and below != room(path):
                assert height[below] < height[room(path)], f"{path}: {module}"


@pytest.mark.parametrize(
    ("modules", "rooms"),
    [
        ({"mpi4py"}, {"study"}),
        (
            {"cvt_hpc.storage.files.written_aside", "cvt_hpc.storage.files.write_rows"},
            {
                "job",
                "study",
                "analysis",
                "experiments",
                "report",
                "papers",
                "storage",
            },
        ),
    ],
)
def test_what_only_some_rooms_do(modules, rooms):
    used = {path: imported(path) | by_module(path) for path in SOURCES}
    assert {room(path) for path, names in used.items() if modules & names} == rooms


def test_models_are_loaded_by_their_contract_but_where_their_readme_says():
    text = (PACKAGE / "models" / "README.md").read_text()
    told = re.search(r"imported outside this folder only in(.*?):", text, re.DOTALL)[1]
    named = {
        (at, model)
        for at, models in re.findall(r"`(\w+)`\s\((.*?)\)", told)
        for model in re.findall(r"\w+", models)
    }
    assert named == {
        (room(path), module.split(".")[2])
        for path in SOURCES
        for module in imported(path)
        if module.startswith("cvt_hpc.models.") and room(path) != "models" and module.split(".")[2] in MODELS
    }


def test_what_test_modules_share_lies_in_support():
    tests = Path(__file__).parents[1]
    modules = {path.stem for path in tests.rglob("test_*.py")}
    for path in tests.rglob("*.py"):
        imports = "\n".join(re.findall(r"^\s*(?:from|import) .*", path.read_text(), re.MULTILINE))
        assert not modules & set(re.findall(r"\w+", imports)), path


def test_no_circle_of_imports():
    # those for a type checker included: a file that cannot be read without another one is no part of its own
    reached = {name: imported(path) & set(FILES) - {name} for name, path in FILES.items()}
    assert sum(map(len, reached.values())) > 500  # the files' imports are seen
    for between in FILES:
        for name in FILES:
            if between in reached[name]:
                reached[name] |= reached[between]
    circles = [{other for other in reached[name] if name in reached[other]} for name in FILES]
    assert [circle for circle in circles if circle] == []


MOST_CONSTANTS = 7  # of a module that an import takes by name; a layout of arrays is imported as a whole


def test_layouts_of_arrays_are_modules_and_not_lists_of_names():
    for path in SOURCES:
        if room(path) not in ("models", "physics", "multibody", "solvers"):
            continue
        for node in statements(tree(path).body):
            if isinstance(node, ast.ImportFrom):
                constants = [alias.name for alias in node.names if alias.name.replace("_", "").isupper()]
                assert len(constants) <= MOST_CONSTANTS, f"{path}: {node.module}: {constants}"


# arrays of kernels whose entries have names, and so have their rows and columns
NAMED = {
    "blocks",
    "narrow",
    "columns",
    "rows",
    "corner",
    "diagonal",
    "links",
    "step",
    "iterate",
    "state",
    "elements",
}
NAMED |= {"stations"}
BY_NAME = ("pushbelt", "spatial_pushbelt", "beam_pushbelt", "quasi_static_belt", "belt_drive")  # models


def numbers_added(node):
    """Whether a sum has a number among its terms, and whether it has the name of a field."""
    terms, ends = [node], []
    while terms:
        term = terms.pop()
        if isinstance(term, ast.BinOp) and isinstance(term.op, ast.Add):
            terms += [term.left, term.right]
        else:
            ends.append(term)
    names = [getattr(end, "attr", getattr(end, "id", "")).isupper() for end in ends]
    return any(isinstance(end, ast.Constant) for end in ends), any(names)


def test_entries_of_arrays_and_of_linear_systems_have_names():
    kernels = [path for path in SOURCES if path.parent.name in BY_NAME and "@kernel" in path.read_text()]
    assert len(kernels) > 20
    for path in kernels:
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.BinOp):
                assert numbers_added(node) != (True, True), f"{path}:{node.lineno}: {ast.unparse(node)}"
            if not isinstance(node, ast.Subscript) or not isinstance(node.slice, ast.Tuple):
                continue
            if getattr(node.value, "attr", getattr(node.value, "id", "")) in NAMED:
                fields = node.slice.elts[1:]
                assert not any(numbers_added(field)[0] for field in fields), f"{path}: {ast.unparse(node)}"


def test_no_kernel_assigns_an_array_to_a_slice():
    """Compiling the message of its error takes some 5 s of a core; `solvers.arrays.copy` has none."""
    for path in SOURCES:
        for function in statements(tree(path).body):
            if "kernel" not in map(ast.unparse, getattr(function, "decorator_list", ())):
                continue
            for node in statements(function.body):
                if isinstance(node, (ast.Assign, ast.AugAssign)) and not isinstance(node.value, ast.Constant):
                    targets = getattr(node, "targets", None) or [node.target]
                    parts = [part for target in targets for part in ast.walk(target)]
                    assert not any(isinstance(part, ast.Slice) for part in parts), f"{path}:{node.lineno}"
