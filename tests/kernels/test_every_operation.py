"""What holds for every operation of the catalogue. A new operation inherits all of it by being declared.

Inputs are drawn to fit the declaration: sizes down to one pixel, one to eight channels, noise, edges, high dynamic
range, zeros, denormals, huge and negative values. Every method at every setting of its knob runs on every backend and
is held to truth within the error it states.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping
from itertools import product
from typing import Any

import numpy as np
import pytest

import lichen
from lichen.accuracy.metrics import difference
from lichen.calibration.corpus import typical
from lichen.errors import InvalidRequest, LichenError, UnknownOperation
from lichen.image import Alpha, Image, Space, as_image
from lichen.opencl.device import default_device
from lichen.operation import Facts, Input, Method, Operation

OPERATIONS = dict(lichen.operations())
BACKENDS = ("opencl", "numpy")
SHAPES = ((1, 1), (1, 9), (7, 1), (33, 47))


def contents(name: str, shape: tuple[int, int, int]) -> np.ndarray:
    """A float32 image by the name of what is hard about it."""
    rng = np.random.default_rng([*name.encode(), *shape])
    noise = rng.random(shape, dtype=np.float32)
    ramp = np.linspace(0, 1, shape[0] * shape[1], dtype=np.float32).reshape(*shape[:2], 1)
    return {
        "noise": noise,
        "edges": np.broadcast_to((ramp > 0.5).astype(np.float32), shape).copy(),
        "highlights": np.where(noise > 0.97, np.float32(1e4), noise),
        "negative": noise - np.float32(0.5),
        "zero": np.zeros(shape, np.float32),
        "denormal": noise * np.float32(1e-40),
        "huge": noise * np.float32(1e30),
    }[name]


CONTENTS = ("noise", "edges", "highlights", "negative", "zero", "denormal", "huge")


def channel_counts(declared: Input) -> list[int]:
    fewest, most = declared.channels
    return [count for count in (1, 2, 3, 4, 5, 8) if count >= fewest and (most is None or count <= most)]


def images(operation: Operation[Any], content: str, size: tuple[int, int], which: int = 0) -> dict[str, Image]:
    """Inputs for an operation; `which` walks through the channel counts it takes."""
    made = {}
    for declared in operation.inputs:
        if declared.required:
            counts = channel_counts(declared)
            made[declared.name] = as_image(contents(content, (*size, counts[which % len(counts)])))
            made[declared.name].pixels.flags.writeable = False  # no method has any business there
    return made


def representable(truth: np.ndarray) -> np.ndarray:
    """Truth with what float32 cannot hold as infinity."""
    return np.where(np.abs(truth) > np.finfo(np.float32).max, np.copysign(np.inf, truth), truth)


def sized(operation: Operation[Any], example: Mapping[str, Any], size: tuple[int, int]) -> dict[str, Any]:
    """The example, of this size where the operation makes its picture itself."""
    return {**example, **({"height": size[0], "width": size[1]} if operation.generates else {})}


def settings(method: Method[Any]) -> tuple[float, ...]:
    return method.knob.values if method.knob else (0.0,)


def ends(method: Method[Any]) -> tuple[float, ...]:
    """The coarsest and the finest setting, between which the others lie."""
    values = settings(method)
    return values if len(values) < 3 else (values[0], values[-1])


def compute(method: Method[Any], backend: str, inputs: Mapping[str, Image], parameters: Any, knob: float) -> np.ndarray:
    with np.errstate(all="ignore"):
        if backend == "numpy":
            return method.implementation.numpy(inputs, parameters, knob)
        device = default_device()
        assert device is not None, "the tests need OpenCL; `lichen doctor` says why there is none"
        return method.implementation.opencl(device, inputs, parameters, knob)


def each() -> pytest.MarkDecorator:
    return pytest.mark.parametrize("operation", list(OPERATIONS.values()), ids=list(OPERATIONS))


@each()
@pytest.mark.parametrize("content", CONTENTS)
def test_methods_keep_the_error_they_state(operation: Operation[Any], content: str) -> None:
    broken, tried = [], 0
    for number, example in enumerate(operation.examples):
        if content != "noise" and (number + CONTENTS.index(content)) % 2 and len(operation.examples) > 1:
            continue  # its turn comes with the next content
        size = SHAPES[number % len(SHAPES)] if number >= 2 else SHAPES[-1 - number]
        parameters = operation.validate(sized(operation, example, size))
        inputs = images(operation, content, size, number)
        facts = {name: Facts.of(image) for name, image in inputs.items()}
        if operation.check(parameters, facts):
            continue
        tried += 1
        truth = representable(operation.evaluate_truth(inputs, parameters))
        for method in operation.methods.values():
            if method.unfit(parameters, facts) is not None:
                continue
            for knob, backend in product(settings(method) if content == "noise" else ends(method), BACKENDS):
                stated = method.error(parameters, knob, facts)
                pixels = compute(method, backend, inputs, parameters, knob)
                assert pixels.dtype == np.float32
                assert pixels.flags.c_contiguous
                found = difference(pixels, truth)
                allowed = stated.value + float(np.finfo(np.float32).tiny)
                if found.largest > allowed or found.mismatched:
                    said = f"{found} beyond {stated}"
                    broken.append(f"{method.name} at {knob:g} on {backend}, {example}, {size}: {said}")
    assert tried or content != "noise", "no example was taken"
    assert not broken, "\n".join(broken)


@each()
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf], ids=["nan", "inf", "-inf"])
def test_nonfinite_values_stay_inside_the_footprint(operation: Operation[Any], backend: str, bad: float) -> None:
    if not any(each.required for each in operation.inputs):
        pytest.skip("it needs no input")
    for number, example in enumerate(operation.examples):
        parameters = operation.validate(example)
        clean = images(operation, "noise", (41, 43), number)
        name = operation.inputs[0].name
        spoilt_pixels = clean[name].pixels.copy()
        spoilt_pixels[20, 21] = bad
        spoilt = {**clean, name: clean[name].replace(pixels=spoilt_pixels)}
        facts = {key: Facts.of(image) for key, image in spoilt.items()}
        if operation.check(parameters, facts):
            continue
        reach = operation.footprint(parameters, facts)
        outside = np.ones((41, 43), bool)
        top, left = (41 if side is None else side for side in (reach.rows, reach.columns))
        outside[max(0, 20 - top) : 21 + top, max(0, 21 - left) : 22 + left] = False
        for method in operation.methods.values():
            if method.unfit(parameters, facts) is None:
                pixels = compute(method, backend, spoilt, parameters, settings(method)[-1])
                if pixels.shape[:2] == outside.shape:
                    assert np.isfinite(pixels[outside]).all(), f"{method.name}, {example}: {bad} left the footprint"


HARD = [(operation, case) for operation in OPERATIONS.values() for case in operation.hard_cases]


@each()
def test_parameters_can_be_given_as_text(operation: Operation[Any]) -> None:
    """As a URL has them: text plain, everything else as JSON."""
    for example in operation.examples:
        text = {name: value if isinstance(value, str) else json.dumps(value) for name, value in example.items()}
        assert operation.validate(text) == operation.validate(example)


@pytest.mark.parametrize(("operation", "case"), HARD, ids=[f"{o.name}: {c.name}" for o, c in HARD])
@pytest.mark.parametrize("backend", BACKENDS)
def test_hard_cases_hold(operation: Operation[Any], case: Any, backend: str) -> None:
    parameters = operation.validate(case.parameters)
    given = case.inputs()
    inputs = {name: as_image(value) for name, value in given.items()}
    facts = {name: Facts.of(image) for name, image in inputs.items()}
    ran = 0
    for method in operation.methods.values():
        if (case.methods and method.name not in case.methods) or method.unfit(parameters, facts) is not None:
            continue
        pixels = compute(method, backend, inputs, parameters, settings(method)[-1])
        wrong = case.holds(given, pixels)
        assert wrong is None, f"{method.name}: {wrong}"
        ran += 1
    assert ran, "no method took the case"


@each()
@pytest.mark.parametrize("backend", BACKENDS)
def test_same_request_same_bytes(operation: Operation[Any], backend: str) -> None:
    """Eight threads at once give what one gave before."""
    inputs = images(operation, "noise", (33, 47))
    example = sized(operation, operation.examples[0], (33, 47))

    def digest() -> str:
        result = lichen.run(operation.name, device=backend, **inputs, **example)
        return hashlib.sha256(result.image.pixels.tobytes()).hexdigest()

    expected, found = digest(), []
    threads = [threading.Thread(target=lambda: found.append(digest())) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [expected] * 8


DIGESTS = f"""
import hashlib, importlib.util, json, lichen
spec = importlib.util.spec_from_file_location("inputs", {__file__!r})
tests = importlib.util.module_from_spec(spec)
spec.loader.exec_module(tests)
results = {{
    name: lichen.run(
        name,
        device="opencl",
        **tests.images(operation, "noise", (150, 131)),
        **tests.sized(operation, operation.examples[0], (150, 131)),
    )
    for name, operation in lichen.operations().items()
}}
print(json.dumps({{n: hashlib.sha256(r.image.pixels.tobytes()).hexdigest() for n, r in results.items()}}))
"""


def test_bytes_do_not_depend_on_the_number_of_threads() -> None:
    """OpenCL cuts the work by its thread count; nothing of that may be seen in the result."""
    digests = []
    for threads in ("1", "2"):
        environment = {**os.environ, "POCL_MAX_PTHREAD_COUNT": threads, "POCL_CPU_MAX_CU_COUNT": threads}
        command = [sys.executable, "-c", DIGESTS]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stderr
        digests.append(json.loads(done.stdout))
    assert digests[0] == digests[1]


@each()
def test_declaration_is_complete(operation: Operation[Any]) -> None:
    assert operation.summary.endswith(".")
    assert operation.description.strip()
    assert len(operation.hard_cases) >= 1
    ranges: dict[str, tuple[float, float]] = {}
    for method in operation.methods.values():
        assert method.description
        assert set(method.rates) == set(BACKENDS)
        if method.knob:
            ends = method.knob.low, method.knob.high
            assert all(ends[0] <= value <= ends[1] for value in method.knob.values)
            # A caller names a knob without its method, and is told one range.
            assert ranges.setdefault(method.knob.name, ends) == ends, f"two ranges of {method.knob.name}"
    for name, told in operation.parameters.model_json_schema()["properties"].items():
        assert told.get("description"), f"{name} has no description"
    json.dumps(operation.schema(), allow_nan=False)
    if operation.customary:
        method, setting = operation.customary
        assert setting in operation.methods[method].settings, "no such candidate is ever taken"
    for example in operation.examples:
        hash(operation.validate(example))  # plans remember what they predicted by it


@each()
def test_flaws_are_all_named_at_once(operation: Operation[Any]) -> None:
    with pytest.raises(InvalidRequest) as caught:
        lichen.run(operation.name, nonsense=1, max_error="much", method="guess", space="cmyk", nonfinite="ignore")
    pointers = {flaw.pointer for flaw in caught.value.flaws}
    assert {"/parameters/nonsense", "/max_error", "/method", "/space", "/nonfinite"} <= pointers


def test_unknown_operation_names_the_nearest() -> None:
    for name in OPERATIONS:
        with pytest.raises(UnknownOperation, match=name):
            lichen.run(name[:-1] + "_")


@each()
@pytest.mark.parametrize("backend", BACKENDS)
def test_whole_road_keeps_the_error_it_states(operation: Operation[Any], backend: str) -> None:
    """With conversions of light and coverage around it, as a picture from a file gets them."""
    if operation.generates:
        _generated_keeps_the_error_it_states(operation, backend)
        return
    declared = operation.inputs[0]
    if not declared.picture or (declared.channels[1] or 4) < 4 or declared.channels[0] > 4:
        pytest.skip("its first input is data")
    picture = Image(contents("noise", (33, 47, 4)), Space.SRGB, Alpha.STRAIGHT)
    for example in operation.examples:
        for storage in ("uint8", "float32"):
            try:
                result = lichen.run(operation.name, picture, device=backend, storage=storage, **example)
            except LichenError:
                continue
            truth = lichen.evaluate_truth(operation.name, picture, device=backend, storage=storage, **example)
            found = difference(result.image.pixels, truth, result.image.alpha)
            assert found.largest <= result.error.value + float(np.finfo(np.float32).tiny), (
                f"{example}: {found} beyond {result.error}"
            )
            assert not found.mismatched


def _generated_keeps_the_error_it_states(operation: Operation[Any], backend: str) -> None:
    for example in operation.examples:
        values = sized(operation, example, (33, 47))
        for storage in ("uint8", "float32"):
            result = lichen.run(operation.name, device=backend, storage=storage, **values)
            truth = lichen.evaluate_truth(operation.name, device=backend, storage=storage, **values)
            found = difference(result.image.pixels, truth)
            assert found.largest <= result.error.value, f"{example}: {found} beyond {result.error}"
            assert not found.mismatched


SIDES = ((9, 64), (40, 40), (300, 200))


def taken(operation: Operation[Any], sides: Iterable[tuple[int, int]]) -> Iterator[tuple[Any, dict[str, Facts]]]:
    """Parameters of examples, and facts of pictures with such heights and widths, as far as they are taken."""
    for example in operation.examples:
        known = typical(operation, operation.validate(example), 32).facts
        for height, width in sides:
            facts = {name: dataclasses.replace(each, height=height, width=width) for name, each in known.items()}
            parameters = operation.sized(operation.validate(example), height, width)
            if not operation.check(parameters, facts):
                yield parameters, facts


@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=OPERATIONS)
def test_no_error_is_less_than_what_it_is_said_to_be_at_least(operation: Operation[Any]) -> None:
    """Where more is said, a method is refused without being asked."""
    for parameters, facts in taken(operation, SIDES):
        for method in operation.methods.values():
            if method.least is None or method.unfit(parameters, facts) is not None:
                continue
            for knob in method.knob.values if method.knob else (0.0,):
                if (least := method.least(parameters, knob, facts)) > 0:
                    stated = method.error(parameters, knob, facts)
                    assert least <= 1.000001 * (min(stated.value, stated.usual) - stated.rounding), (method, knob)


@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=OPERATIONS)
def test_settings_take_more_work_and_err_less_one_after_the_other(operation: Operation[Any]) -> None:
    """Where they are said to: else a quicker setting were not looked at, or one that is accurate enough."""
    for parameters, facts in taken(operation, (*SIDES, (300, 64), (1400, 2000))):
        for method in operation.methods.values():
            if method.knob is None or method.unfit(parameters, facts) is not None:
                continue
            work = [method.work(parameters, setting, facts) for setting in method.knob.values]
            if method.knob.rising:
                assert work == sorted(work), (method.name, parameters)
            if method.lightest is not None:
                for at, setting in enumerate(method.knob.values):
                    assert method.lightest(parameters, setting, facts) <= min(work[at:]), (method.name, parameters)
            if method.orderly:
                stated = [method.error(parameters, setting, facts) for setting in method.knob.values]
                apart = [min(each.value, each.usual) - each.rounding for each in stated]
                assert apart == sorted(apart, reverse=True), (method.name, parameters)
                if method.knob.rising and work[0] == work[-1]:
                    assert stated[-1].value == min(each.value for each in stated), (method.name, parameters)
