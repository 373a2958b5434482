"""Small pieces: how long functions and files are, and how many files a folder holds."""

import ast
from pathlib import Path
from statistics import median

import pytest
from places import ROOT

PARTS = ("backend", "frontends", "recordings", "service")
FILES = sorted(path for part in PARTS for path in (ROOT / part).rglob("*.py"))
FOLDERS = sorted({path.parent for path in FILES})
TEST_FOLDERS = sorted({path.parent for path in (ROOT / "tests").rglob("*.py")})
MOST_LINES_OF_A_FILE = 300
MOST_LINES_OF_A_FUNCTION = 60
MEDIAN_LINES_OF_A_FUNCTION = 8
MOST_FILES_IN_A_FOLDER = 20


def functions(path: Path) -> list[tuple[str, int]]:
    """The functions of a file, each with how many lines it takes from `def` on."""
    nodes = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef)]
    return [(node.name, (node.end_lineno or node.lineno) - node.lineno + 1) for node in nodes]


def test_most_functions_are_short() -> None:
    assert median(lines for path in FILES for _, lines in functions(path)) <= MEDIAN_LINES_OF_A_FUNCTION


def test_no_function_is_long() -> None:
    long = {f"{path}:{name}" for path in FILES for name, lines in functions(path) if lines > MOST_LINES_OF_A_FUNCTION}
    assert not long


@pytest.mark.parametrize("path", FILES, ids=[str(path.relative_to(ROOT)) for path in FILES])
def test_a_file_is_one_idea(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= MOST_LINES_OF_A_FILE


def assert_few_files(folder: Path) -> None:
    assert len(list(folder.glob("*.py"))) <= MOST_FILES_IN_A_FOLDER


@pytest.mark.parametrize("folder", TEST_FOLDERS, ids=[str(folder.relative_to(ROOT)) for folder in TEST_FOLDERS])
def test_a_folder_of_tests_can_be_taken_in_at_a_glance(folder: Path) -> None:
    assert_few_files(folder)


@pytest.mark.parametrize("folder", FOLDERS, ids=[str(folder.relative_to(ROOT)) for folder in FOLDERS])
def test_a_folder_can_be_taken_in_at_a_glance_and_says_what_lives_there(folder: Path) -> None:
    assert_few_files(folder)
    said = ast.get_docstring(ast.parse((folder / "__init__.py").read_text()))
    assert said
    assert said.splitlines()[0].endswith((".", ":"))
