"""What is installed is what the tree holds, and the tree declares what it imports."""

from __future__ import annotations

import ast
import functools
import importlib.metadata
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOTS = {
    "lichen": "kernels",
    "lichen_service": "service",
    "lichen_client": "clients/python",
    "lichen_batch": "clients/batch",
    "lichen_cli": "clients/cli",
}
SCRIPTS = ("run", "install-system", "container-test")


def test_the_wheel_holds_every_file_of_the_packages(root: Path, tracked: list[Path], tmp_path: Path) -> None:
    source = tmp_path / "source"
    for path in tracked:
        if path.parts[0] in ("kernels", "service", "clients") or len(path.parts) == 1:
            (source / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(root / path, source / path)
    build = "import sys; from setuptools import build_meta; print(build_meta.build_wheel(sys.argv[1]))"
    built = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", build, str(tmp_path)],
        cwd=source,
        check=True,
        capture_output=True,
        text=True,
    )
    held = set(zipfile.ZipFile(tmp_path / built.stdout.splitlines()[-1]).namelist())
    expected = {
        path.relative_to(folder).as_posix()
        for package, folder in ROOTS.items()
        for path in tracked
        if path.is_relative_to(Path(folder) / package)
    }
    assert any(name.endswith(".cl") for name in expected)
    assert expected - held == set()
    assert {name for name in held - expected if ".dist-info/" not in name} == set()


def imported(folders: Iterable[Path]) -> dict[str, str]:
    """Top-level modules that Python files import and that are neither theirs, nor ours, nor Python's: where each is."""
    files = [path for folder in folders for path in sorted(folder.rglob("*.py"))]
    own = {*ROOTS, *(path.stem for path in files if "tests" in path.parts), *sys.stdlib_module_names}
    own |= {path.parent.name for path in files if path.parent.parent.name == "benchmarks"}
    found = {}
    for path in files:
        for node in ast.walk(ast.parse(path.read_text())):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names = [node.module]
            found |= {top: str(path) for name in names if (top := name.partition(".")[0]) not in own}
    return found


TOO_LARGE = {"vtkmodules": ["vtk"]}
"""What modules of extras belong to that are not installed for tests."""


@functools.cache
def providers(module: str) -> set[str]:
    """Distributions that provide a module; one of the module's own name is always taken to."""
    return {canonicalize_name(name) for name in [module, *distributions().get(module, TOO_LARGE.get(module, []))]}


distributions = functools.cache(importlib.metadata.packages_distributions)


def undeclared(modules: Mapping[str, str], requirements: list[Requirement]) -> dict[str, str]:
    declared = {canonicalize_name(requirement.name) for requirement in requirements}
    return {module: path for module, path in modules.items() if not providers(module) & declared}


def extras_of(project: dict[str, Any]) -> list[Requirement]:
    extras = project["project"]["optional-dependencies"].values()
    return [Requirement(each) for extra in extras for each in extra]


def test_every_import_is_declared_and_every_dependency_imported(
    root: Path, asked: Callable[..., list[Requirement]], project: dict[str, Any]
) -> None:
    extras = extras_of(project)
    modules = imported(root / folder / package for package, folder in ROOTS.items())
    assert undeclared(modules, [*asked(), *extras]) == {}
    used = {name for module in modules for name in providers(module)}
    assert [each for each in [*asked(), *extras] if canonicalize_name(each.name) not in used] == []


def test_what_the_tests_import_is_declared_too(
    root: Path, asked: Callable[..., list[Requirement]], project: dict[str, Any]
) -> None:
    assert undeclared(imported([root / "tests", root / "docs"]), [*asked("dev"), *extras_of(project)]) == {}


def test_system_packages_are_named_in_one_place(root: Path, tracked: list[Path]) -> None:
    packages = [line.partition("#")[0].strip() for line in (root / ".ci/system-packages.txt").read_text().splitlines()]
    runtime = next(name for name in packages if "pocl" in name)
    machinery = [path for path in tracked if path.parts[0] in (".ci", "Makefile", "Containerfile")]
    assert len(machinery) >= len(SCRIPTS) + 3
    assert [path.name for path in machinery if runtime in (root / path).read_text()] == ["system-packages.txt"]


@pytest.mark.parametrize("name", SCRIPTS)
def test_scripts_can_be_run(root: Path, name: str) -> None:
    script = root / ".ci" / name
    assert os.access(script, os.X_OK)
    shell = script.read_text().splitlines()[0].split()[-1].removeprefix("#!").rpartition("/")[2]
    subprocess.run([shell, "-n", str(script)], check=True)


@pytest.fixture
def installer(root: Path) -> Iterator[Path]:
    """A copy of the installer, readable by everyone, beside a list that asks only for what every Debian has."""
    if not shutil.which("dpkg-query"):
        pytest.skip("no Debian packages here")
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        shutil.copy(root / ".ci/install-system", folder)
        Path(folder, "system-packages.txt").write_text("# always there\nbase-files  # and a remark\n\ndpkg\n")
        yield Path(folder, "install-system")


def test_the_installer_is_silent_when_nothing_is_missing(installer: Path) -> None:
    done = subprocess.run([installer, "--require"], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


@pytest.mark.parametrize(("arguments", "status"), [([], 0), (["--require"], 1)])
def test_without_rights_the_installer_says_what_to_install(installer: Path, arguments: list[str], status: int) -> None:
    if os.getuid() != 0:
        pytest.skip("only root can become a user known to have no rights")
    missing = "a-package-that-is-not-there"
    with installer.with_name("system-packages.txt").open("a") as names:
        names.write(missing + "\n")
    nobody = 65534
    done = subprocess.run(
        [installer, *arguments], user=nobody, group=nobody, extra_groups=[], capture_output=True, text=True
    )
    assert done.returncode == status
    assert f"apt-get install --no-install-recommends {missing}" in done.stderr
    assert "NumPy" in done.stderr
