"""The blocking client: a thin transport under the rules of `calls` and `retry`."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Self

from lichen_client import calls
from lichen_client.calls import Call
from lichen_client.errors import ConnectionFailed
from lichen_client.results import Result, Results
from lichen_client.retry import Reply, Wait, conversation
from lichen_client.transport import Transport, failures, reply_of

if TYPE_CHECKING:
    from lichen_client.calls import ImageLike
    from lichen_client.pipeline import Pipeline


class Client(Transport):
    """A connection to a Lichen service, for blocking code.

    >>> with Client("http://127.0.0.1:8080") as client:  # doctest: +SKIP
    ...     result = client.run("gaussian", "photo.jpg", sigma=5)
    ...     result.array.shape, result.report.method, result.report.error

    One client may be used by any number of threads at once. Close it, or use it in a `with` block, to give back its
    connections. `timeout` is checked between reads, so an answer that trickles may overrun it by one pause.
    """

    def _open(self) -> None:
        import httpx2

        self._http = httpx2.Client(**self._arguments())

    def run(self, operation: str, image: ImageLike = None, /, *, format: str | None = None, **values: Any) -> Result:
        """Runs an operation and returns its result.

        image: the operation's first input: an array (height, width[, channels]), the bytes of an encoded image, or a
            path to one. Further inputs are keywords holding arrays, bytes or `pathlib.Path`s.
        format: name of the format to get the encoded image in, such as "png"; without it the result is an array.
        values: the operation's parameters and knobs, and the service's own: method, max_error, max_ms, device,
            nonfinite, space, storage ...

        Raises `StatusError` (what the service says against it), `ConnectionFailed`, or OSError for an unreadable path.
        """
        return calls.read_result(self._converse(calls.run_call(operation, image, values, format=format)))

    def explain(
        self, operation: str, image: ImageLike = None, /, *, format: str | None = None, **values: Any
    ) -> dict[str, Any]:
        """The plan the service would follow for the same `run`, and why; no pixel is computed."""
        call = calls.run_call(operation, image, values, format=format, explain=True)
        return self._document(call)

    def run_pipeline(
        self,
        pipeline: Pipeline | Mapping[str, Any] | str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> Results:
        """Runs a pipeline and returns its results by the names of its outputs.

        pipeline: a `Pipeline`, a mapping of nodes and outputs, or the text form, such as
            "gaussian:sigma=5|levels:gamma=1.2", whose output is called `result`.
        image: the picture that nodes read as `input.image`; `images` holds all of them by name.
        format: of outputs that name none; without it they are arrays.
        wishes: the service's own: max_error, max_ms, device, nonfinite, storage, space, precision, verify ...

        Raises as `run`.
        """
        call = calls.pipeline_call(pipeline, image, images, wishes, format=format)
        return calls.read_results(self._converse(call))

    def explain_pipeline(
        self,
        pipeline: Pipeline | Mapping[str, Any] | str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> dict[str, Any]:
        """The plan the service would follow for the same `run_pipeline`, and why; no pixel is computed."""
        call = calls.pipeline_call(pipeline, image, images, wishes, format=format, explain=True)
        return self._document(call)

    def render(
        self,
        scene: Mapping[str, Any] | str,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> Result:
        """Renders a scene: a mapping or its JSON; `images` holds the buffers that it names.

        format: of the picture; without it an array of scene-linear light.
        wishes: as those of `run_pipeline`; `prune=False` computes what cannot be seen, too.

        Raises as `run`.
        """
        return calls.read_result(self._converse(calls.scene_call(scene, images, wishes, format=format)))

    def explain_scene(
        self,
        scene: Mapping[str, Any] | str,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> dict[str, Any]:
        """Which effects the service would run for the same `render`, and why not the others; no pixel is computed."""
        return self._document(calls.scene_call(scene, images, wishes, format=format, explain=True))

    def operations(self) -> dict[str, Any]:
        """What the service can do: the document of /v1/operations."""
        return self._document(calls.get_call("v1", "operations"))

    def operation(self, name: str) -> dict[str, Any]:
        """One operation: parameters with ranges and units, inputs, methods, limits."""
        return self._document(calls.get_call("v1", "operations", name))

    def version(self) -> dict[str, Any]:
        """Versions of the service and of what it stands on."""
        return self._document(calls.get_call("v1", "version"))

    def close(self) -> None:
        self._http.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _document(self, call: Call) -> dict[str, Any]:
        return calls.read_json(self._converse(call))

    def _converse(self, call: Call) -> Reply:
        steps = conversation(self.timeout, self.retries)
        outcome: Reply | ConnectionFailed | None = None
        try:
            while True:
                step = steps.send(outcome)
                if isinstance(step, Wait):
                    time.sleep(step.seconds)
                    outcome = None
                    continue
                try:
                    outcome = self._send(call, step.deadline)
                except ConnectionFailed as failure:
                    outcome = failure
        except StopIteration as end:
            reply: Reply = end.value
            return reply

    def _send(self, call: Call, deadline: float) -> Reply:
        body = bytearray()
        with failures(call, self.url), self._http.stream(**self._request(call, deadline)) as response:
            for piece in response.iter_bytes():
                body += piece
                if time.monotonic() > deadline:
                    raise TimeoutError
            return reply_of(response, body)
