"""Every sub-package is in the wheel: a folder that pyproject.toml does not list is missing once it is installed."""

import tomllib

from places import ROOT

PARTS = ("service", "frontends", "backend", "recordings")
FACADE = "service/library"  # is installed as `wayfi` itself


def package_of(folder: str) -> str:
    return "wayfi" if folder == FACADE else f"wayfi.{folder.replace('/', '.')}"


def test_every_folder_with_an_init_is_in_both_tables_and_nothing_else_is() -> None:
    setuptools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    inits = [path for part in PARTS for path in (ROOT / part).rglob("__init__.py")]
    folders = {path.parent.relative_to(ROOT).as_posix() for path in inits}
    assert len(folders) > 20
    assert setuptools["package-dir"] == {package_of(folder): folder for folder in folders}
    assert sorted(setuptools["packages"]) == sorted(map(package_of, folders))


def test_every_part_and_the_library_say_that_they_are_typed() -> None:
    assert all((ROOT / folder / "py.typed").is_file() for folder in (*PARTS, FACADE))


def test_every_folder_with_modules_is_a_package() -> None:
    modules = [path for part in PARTS for path in (ROOT / part).rglob("*.py")]
    assert not {path.parent for path in modules if not (path.parent / "__init__.py").is_file()}
