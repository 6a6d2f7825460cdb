"""Operations are found by the names of their files."""

from __future__ import annotations

import subprocess
import sys

import pytest

from lichen import catalogue
from lichen.errors import UnknownOperation


def test_each_operation_is_found_without_loading_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    everything = catalogue.operations()
    monkeypatch.setattr(catalogue, "operations", dict)
    assert {name: catalogue.known(name) for name in everything} == dict(everything)
    with pytest.raises(UnknownOperation):
        catalogue.operation("launch")  # a module that declares none


def test_one_operation_loads_few_modules() -> None:
    code = (
        "import sys; from lichen.catalogue import operation; operation('gaussian'); "
        "print(*(name for name in sys.modules if name.startswith(('lichen.operations.noise.', 'scipy'))))"
    )
    assert not subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.strip()
