"""Sessions on the real device: results, memory, threads, and what is said when something is wrong."""

from __future__ import annotations

import dataclasses
import threading
from pathlib import Path

import numpy as np
import pytest

from lichen.errors import DeviceFailure
from lichen.memory import aligned_empty
from lichen.opencl.device import Device
from lichen.opencl.session import Session, widened
from lichen.opencl.watching import watch, watched

SOURCE = str(Path(__file__).with_name("trial.cl"))


def scale(session: Session, given: np.ndarray, out: np.ndarray, **options: object) -> None:
    count = np.int32(given.size)
    session.launch(SOURCE, "scale", (given.size,), given, session.write(out), count, **options)  # type: ignore[arg-type]


def ramp(count: int) -> np.ndarray:
    values = aligned_empty((count,))
    values[:] = np.arange(count)
    return values


@pytest.mark.parametrize("count", [1, 63, 64, 65, 1000])
def test_grids_are_padded_and_bounded(device: Device, count: int) -> None:
    out = aligned_empty((count + 1,))
    out[-1] = -7
    with device.session() as session:
        session.launch(SOURCE, "scale", (count,), ramp(count), session.readwrite(out), np.int32(count))
    assert np.array_equal(out[:-1], 2 * np.arange(count))
    assert out[-1] == -7


def test_two_dimensions(device: Device) -> None:
    out = aligned_empty((5, 67), np.int32)
    with device.session() as session:
        session.launch(SOURCE, "place", (67, 5), session.write(out), np.int32(67), np.int32(5))
    assert np.array_equal(out, 1000 * np.arange(5)[:, np.newaxis] + np.arange(67))


def test_what_is_watched_is_carried_out_in_parts_to_the_same_bytes_and_ends_when_it_shall(device: Device) -> None:
    def place(rows: int) -> np.ndarray:
        out = aligned_empty((rows, 67), np.int32)
        out.fill(-1)
        with device.session() as session:
            session.launch(SOURCE, "place", (67, rows), session.readwrite(out), np.int32(67), np.int32(rows))
        return out

    asked: list[int] = []

    def look() -> None:
        asked.append(len(asked))
        if len(asked) == most:
            raise TimeoutError

    most = 10_000
    with watched(look):
        assert np.array_equal(place(500), place(500))
    assert len(asked) > 2, "the first launch has parts"
    assert np.array_equal(place(500), 1000 * np.arange(500)[:, np.newaxis] + np.arange(67))
    most = len(asked) + 2
    kept = aligned_empty((500, 67), np.int32)
    kept.fill(-1)
    with watched(look), pytest.raises(TimeoutError), device.session() as session:
        session.launch(SOURCE, "place", (67, 500), session.readwrite(kept), np.int32(67), np.int32(500))
    assert 0 < (kept >= 0).sum() < kept.size, "it has begun and has not come to its end"
    assert watch() is None


def test_launches_see_what_earlier_ones_wrote(device: Device) -> None:
    given, out = ramp(500), aligned_empty((500,))
    with device.session() as session:
        between = aligned_empty((500,))
        scale(session, given, between)
        for _ in range(3):
            session.launch(SOURCE, "increase", (500,), session.readwrite(between), np.int32(500))
        scale(session, between, out)
        session.finish()
        assert np.array_equal(out, 4 * given + 6)  # readable between launches, too
        scale(session, out, between)
    assert np.array_equal(between, 8 * given + 12)


def test_aligned_arrays_are_not_copied_and_others_are(device: Device) -> None:
    whole = ramp(1001)
    with device.session() as session:
        assert session.read(whole).memory is whole
        assert session.read(whole) is session.read(whole[:])
        assert session.read(whole[1:]).copied
        assert session.read(whole[::2]).copied


@pytest.mark.parametrize("part", [slice(1, 301), slice(0, 600, 2), slice(None, None, -1)])
def test_arrays_of_any_layout(device: Device, part: slice) -> None:
    given, out = ramp(700)[part], ramp(700)
    before = out.copy()
    with device.session() as session:
        scale(session, given, out[part])
    before[part] = 2 * given
    assert np.array_equal(out, before)


def test_unaligned_arrays_written_in_part_keep_the_rest(device: Device) -> None:
    values = ramp(101)[1:]
    with device.session() as session:
        session.launch(SOURCE, "increase", (10,), session.readwrite(values), np.int32(10))
    assert np.array_equal(values, np.arange(1, 101) + (np.arange(100) < 10))


def test_read_only_arrays_are_read_and_never_written(device: Device) -> None:
    given, out = ramp(100), aligned_empty((100,))
    given.flags.writeable = False
    with device.session() as session:
        scale(session, given, out)
        with pytest.raises(ValueError, match="read-only"):
            session.write(given)
    assert np.array_equal(out, 2 * given)


def test_overlapping_arrays_may_not_be_written(device: Device) -> None:
    values = ramp(256)
    with device.session() as session:
        session.read(values)
        session.read(values[64:])
        with pytest.raises(ValueError, match="overlap"):
            session.write(values[32:64])
    with device.session() as session:
        session.write(values[:128])
        session.write(values[128:])


def test_scratch_holds_values_between_launches(device: Device) -> None:
    given, out = ramp(500), aligned_empty((500,))
    with device.session() as session:
        between = session.scratch((500,))
        scale(session, given, between)
        scale(session, between, out)
    assert np.array_equal(out, 4 * given)


@pytest.mark.parametrize("apart", [False, True])
def test_devices_whose_items_step_together(device: Device, apart: bool) -> None:
    wide = dataclasses.replace(device, lanes=32, shares_memory=not apart)
    assert widened((1, 16), 32) == (2, 16)
    out = aligned_empty((5, 67), np.int32)
    with wide.session() as session:
        session.launch(SOURCE, "place", (67, 5), session.write(out), np.int32(67), np.int32(5), local=(1, 1))
    assert np.array_equal(out, 1000 * np.arange(5)[:, np.newaxis] + np.arange(67))
    given, twice = ramp(500), aligned_empty((500,))
    with wide.session() as session:
        between = session.scratch((500,))
        scale(session, given, between)
        scale(session, between, twice)
    assert np.array_equal(twice, 4 * given)


def test_null_pointers(device: Device) -> None:
    found = aligned_empty((1,), np.int32)
    for argument, expected in ((None, 0), (ramp(4), 1)):
        with device.session() as session:
            session.launch(SOURCE, "given", (1,), argument, session.write(found))
        assert found[0] == expected


def test_definitions_make_their_own_programs(device: Device) -> None:
    given, out = ramp(100), aligned_empty((100,))
    for factor in (3, 0.1, "(1.0f / 3.0f)"):
        with device.session() as session:
            scale(session, given, out, defines={"FACTOR": factor})
        exact = np.float32(1) / np.float32(3) if isinstance(factor, str) else np.float32(factor)
        assert np.array_equal(out, given * exact)


def test_products_are_fused_only_where_a_kernel_says_so(device: Device) -> None:
    near = np.float32(1 + 2**-12)
    out = aligned_empty((1,))
    with device.session() as session:
        session.launch(SOURCE, "unfused", (1,), near, near, np.float32(-(1 + 2**-11)), session.write(out))
    assert out[0] == 0


def test_build_errors_name_source_line_and_cause(device: Device, tmp_path: Path) -> None:
    (tmp_path / "part.clh").write_text("#pragma once\n\nfloat part(float x) { return x + missing_name; }\n")
    broken = tmp_path / "broken.cl"
    broken.write_text('#include "part.clh"\n__kernel void run(__global float* a) { a[0] = part(a[0]); }\n')
    with pytest.raises(DeviceFailure) as raised, device.session() as session:
        session.launch(str(broken), "run", (1,), ramp(1), defines={"SIZE": 3})
    for expected in ("broken.cl", "SIZE 3", "part.clh:3", "missing_name"):
        assert expected in str(raised.value)


def test_a_function_that_is_not_declared_costs_a_second_build(device: Device, tmp_path: Path) -> None:
    if "Portable Computing Language" not in device.runtime:
        pytest.skip("other runtimes read no header")
    (tmp_path / "rare.cl").write_text(
        "__kernel void run(__global float* a) { if (!get_global_id(0)) a[0] = tan(a[0]); }"
    )
    out = ramp(5)[4:]
    said = r"rare.cl needs more than language.clh declares:[\s\S]*tan"
    with pytest.warns(UserWarning, match=said), device.session() as session:
        session.launch(str(tmp_path / "rare.cl"), "run", (1,), session.readwrite(out))
    assert out[0] == pytest.approx(np.tan(4), rel=1e-5)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("name", ["ceil", "floor", "rint", "trunc"])
def test_whole_numbers_beside_every_number_are_those_of_the_definition(
    device: Device, name: str, kind: type, tmp_path: Path
) -> None:
    if kind is np.float64 and not device.has_fp64:
        pytest.skip("a device without doubles")
    digits = 2.0 ** (23 if kind is np.float32 else 52)
    near = np.array([0, 0.3, 0.5, 1, 1.5, 2.5, digits / 2 + 0.5, digits - 0.5, digits + 1, 3 * digits, 1e-40, np.inf])
    random = np.random.default_rng(5).normal(0, 1e4, 200)
    given = aligned_empty((224,), kind)
    given[:] = np.concatenate([near, -near, random])
    given[-1] = np.nan
    word = "float" if kind is np.float32 else "double"
    (tmp_path / "whole.cl").write_text(f"""
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
kernel void run(global const {word} *in, global {word} *out, int count)
{{
    int i = get_global_id(0);
    if (i >= count)
        return;
    out[i] = {name}(in[i]);
    vstore16({name}(vload16(i / 16, in)), i / 16, out + count);
}}
""")
    out = aligned_empty((2 * given.size,), kind)
    with device.session() as session:
        session.launch(
            str(tmp_path / "whole.cl"), "run", (given.size,), given, session.write(out), np.int32(given.size)
        )
    wanted = getattr(np, name)(given)
    for made in (out[: given.size], out[given.size :]):
        assert np.array_equal(made, wanted, equal_nan=True)
        assert np.array_equal(np.signbit(made[:-1]), np.signbit(wanted[:-1]))


def test_wrong_launches_say_what_is_wrong(device: Device) -> None:
    values, count = ramp(8), np.int32(8)
    with device.session() as session:
        with pytest.raises(DeviceFailure, match=r"no kernel shrink \(it has .*scale"):
            session.launch(SOURCE, "shrink", (8,), values)
        with pytest.raises(DeviceFailure, match="no kernel source nowhere"):
            session.launch("nowhere.cl", "scale", (8,), values)
        with pytest.raises(TypeError, match="takes 2 arguments, got 1"):
            session.launch(SOURCE, "increase", (8,), values)
        with pytest.raises(TypeError, match="argument 1: int has no fixed width"):
            session.launch(SOURCE, "increase", (8,), values, 8)  # type: ignore[arg-type]
        with pytest.raises(DeviceFailure, match=r"increase of .* refuses argument 1 \(int64\)"):
            session.launch(SOURCE, "increase", (8,), session.readwrite(values), np.int64(8))
        with pytest.raises(DeviceFailure, match=r"increase of .* could not be launched"):
            session.launch(SOURCE, "increase", (8,), session.readwrite(values), count, local=(1 << 20,))
        with pytest.raises(ValueError, match="holds nothing"):
            session.read(np.empty((0, 3), np.float32))
        session.launch(SOURCE, "increase", (8,), session.readwrite(values), count)
    assert np.array_equal(values, np.arange(8) + 1)  # the session survives all of them


def test_an_exception_leaves_nothing_behind(device: Device) -> None:
    given, out = ramp(1 << 20), aligned_empty((1 << 20,))
    session = device.session()

    def interrupted() -> None:
        with session:
            for _ in range(20):
                scale(session, given, out)
            raise KeyError("interrupted")

    with pytest.raises(KeyError, match="interrupted"):
        interrupted()
    assert not session._held
    with device.session() as session:
        scale(session, given, out)
    assert np.array_equal(out, 2 * given)


def test_threads_run_side_by_side(device: Device) -> None:
    wrong: list[object] = []

    def work(seed: int) -> None:
        try:
            random = np.random.default_rng(seed)
            for turn in range(40):
                given = random.random(1000 + seed).astype(np.float32)
                out = aligned_empty(given.shape)
                factor = 2 + turn % 3
                with device.session() as session:
                    scale(session, given, out, defines={"FACTOR": float(factor)})
                if not np.array_equal(out, given * np.float32(factor)):
                    wrong.append((seed, turn))
        except Exception as error:
            wrong.append(error)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="resident memory is read from /proc")
def test_buffers_are_released(device: Device) -> None:
    def launch(times: int) -> None:
        for _ in range(times):
            given, out = np.ones(1 << 16, np.float32), aligned_empty((1 << 16,))
            with device.session() as session:
                scale(session, given[1:], out[1:])

    launch(200)
    before = resident()
    launch(2000)
    assert resident() - before < 32 << 20  # one array kept per launch would be 500 MiB
