"""The choice of a device, each in a process of its own: what is found, what is refused, and the reason given."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lichen.opencl import cache
from lichen.opencl.device import Device, ends_processes

REPORT = """
import json, logging
logging.basicConfig(level=logging.INFO, format="%(levelname)s %(name)s %(message)s")
from lichen.opencl.device import default_device, status
device = default_device()
assert default_device() is device
print(json.dumps({"name": device and device.name, "reason": status().reason, "cache": str(status().cache)}))
"""


def report(script: str = REPORT, **environment: str | Path) -> tuple[dict[str, str | None], str]:
    """What a fresh process says: the last line of its output, and its log."""
    cleared = {name: value for name, value in os.environ.items() if not name.startswith(("LICHEN_", "POCL_"))}
    ran = subprocess.run(
        [sys.executable, "-c", script],
        env=cleared | {name: str(value) for name, value in environment.items()},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ran.returncode == 0, ran.stderr
    said: dict[str, str | None] = json.loads(ran.stdout.splitlines()[-1])
    return said, ran.stderr


def test_numpy_is_taken_at_its_word() -> None:
    said, log = report(LICHEN_DEVICE="numpy")
    assert said["name"] is None
    assert said["reason"] == "LICHEN_DEVICE=numpy asks for it"
    assert log.count("NumPy serves") == 1
    assert "WARNING" not in log


def test_part_of_a_name_chooses(device: Device) -> None:
    said, _ = report(LICHEN_DEVICE=device.name[:6].upper())
    assert said["name"] == device.name


def test_an_unknown_device_is_refused_with_those_there_are(device: Device) -> None:
    said, log = report(LICHEN_DEVICE="abacus")
    assert said["name"] is None
    assert "no device is called abacus" in str(said["reason"])
    assert device.name in str(said["reason"])
    assert log.count("WARNING lichen NumPy serves") == 1


def test_no_runtime(tmp_path: Path) -> None:
    said, _ = report(OCL_ICD_VENDORS=f"{tmp_path}/", OCL_ICD_FILENAMES="")
    assert said["name"] is None
    assert "OpenCL runtime" in str(said["reason"])


def test_a_missing_linker_is_found_before_it_ends_the_process(device: Device, tmp_path: Path) -> None:
    said, _ = report(PATH=tmp_path, POCL_CACHE_DIR=tmp_path / "kernels")
    if "Portable Computing Language" in device.runtime:
        assert "no linker" in str(said["reason"])
    else:
        assert said["name"] == device.name


@pytest.mark.parametrize(
    ("runtime", "ends"),
    [
        (
            "Portable Computing Language OpenCL 3.0 PoCL 6.0+debian  Linux, None+Asserts, RELOC, SPIR-V, LLVM 18.1.8",
            True,
        ),
        (
            "Portable Computing Language OpenCL 3.0 PoCL 6.0+debian  Linux, None+Asserts, RELOC, SPIR-V, LLVM 17.0.6",
            False,
        ),
        (
            "Portable Computing Language OpenCL 3.0 PoCL 3.1+debian  Linux, None+Asserts, RELOC, SPIR, LLVM 15.0.6",
            False,
        ),
        ("NVIDIA CUDA OpenCL 3.0 CUDA 12.4.131", False),
    ],
)
def test_a_runtime_that_ends_the_process_is_refused(runtime: str, ends: bool) -> None:
    assert (ends_processes(runtime) is not None) == ends


def test_a_trial_that_fails_to_build_gives_its_log(device: Device, tmp_path: Path) -> None:
    (tmp_path / "probe.cl").write_text("__kernel void probe(__global float* a) { a[0] = missing_name; }")
    broken = f"from lichen.opencl import programs; programs.ROOTS = (__import__('pathlib').Path({str(tmp_path)!r}),)\n"
    said, log = report(broken + REPORT)
    assert said["name"] is None
    assert "no device passed its trial" in str(said["reason"])
    assert "missing_name" in log


def test_a_trial_with_wrong_numbers_is_refused(device: Device, tmp_path: Path) -> None:
    signature = "__global const float* in, __global float* out, int vectors"
    (tmp_path / "probe.cl").write_text(f"__kernel void probe({signature}) {{ out[get_global_id(0)] = 1.0f; }}")
    wrong = f"from lichen.opencl import programs; programs.ROOTS = (__import__('pathlib').Path({str(tmp_path)!r}),)\n"
    said, _ = report(wrong + REPORT)
    assert "wrong numbers" in str(said["reason"])


def test_an_unwritable_cache_is_replaced(device: Device, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    said, log = report(XDG_CACHE_HOME=tmp_path / "file", TMPDIR=tmp_path)
    assert said["name"] == device.name
    assert Path(str(said["cache"])).parent == tmp_path
    assert "cannot be written" in log
    assert not list(tmp_path.glob("lichen-pocl-*")), "the temporary folder is removed when the process ends"


def test_no_cache_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path / "file" / "kernels"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "file"))
    with pytest.raises(cache.NoCache, match=r"kernels cannot be written .* no temporary folder"):
        cache.prepare()


def test_a_cache_that_forbids_execution_is_refused() -> None:
    candidates = [Path(folder) for folder in ("/dev/shm", "/run/lock", "/run", "/dev/mqueue") if Path(folder).is_dir()]
    forbidding = [folder for folder in candidates if os.statvfs(folder).f_flag & os.ST_NOEXEC]
    writable = [folder for folder in forbidding if os.access(folder, os.W_OK)]
    if not writable:
        pytest.skip("no writable file system here is mounted noexec")
    assert "noexec" in str(cache.flaw(writable[0]))


def test_a_fork_is_refused_and_its_parent_unharmed(device: Device) -> None:
    said, log = report(
        REPORT.replace(
            "print(",
            """
import os
from lichen.errors import DeviceFailure
if not (child := os.fork()):
    assert default_device() is None and "fork" in status().reason
    try:
        device.session()
    except DeviceFailure as failure:
        os._exit(0 if "spawn" in str(failure) else 3)
    os._exit(4)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
assert default_device() is device
print(""",
        )
    )
    assert said["name"] == device.name
    assert "use spawn" in log


def test_the_thread_count_follows_the_affinity_mask(device: Device) -> None:
    pinned = "import os; os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])\n"
    ask = pinned + REPORT.replace('"reason"', '"units": str(device.compute_units), "reason"')
    said, _ = report(ask)
    assert said["units"] == "1"
