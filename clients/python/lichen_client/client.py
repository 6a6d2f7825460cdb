"""The blocking client: a thin transport under the rules of `calls` and `retry`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Self

from lichen_client import calls, jobs
from lichen_client.calls import Asset, Call
from lichen_client.errors import ConnectionFailed, TimedOut
from lichen_client.operations import Operations
from lichen_client.raw import Raw
from lichen_client.results import Result, Results
from lichen_client.retry import Reply, Wait, conversation
from lichen_client.streams import PIECE, Stream, cut
from lichen_client.transport import CONNECT_TIMEOUT, Transport, direct, failures, left_of, reply_of

if TYPE_CHECKING:
    from lichen_client.calls import ImageLike
    from lichen_client.jobs import Progress, State
    from lichen_client.pipeline import Pipeline
    from lichen_client.scene import Scene


class Client(Transport, Operations[Result]):
    """A connection to a Lichen service, for blocking code.

    >>> with Client("http://127.0.0.1:8080") as client:  # doctest: +SKIP
    ...     result = client.gaussian("photo.jpg", sigma=5)
    ...     result.array.shape, result.report.method, result.report.error

    Every operation is a method; `run` takes the name of any, also of one that is newer than this client.

    One client may be used by any number of threads at once. Close it, or use it in a `with` block, to give back its
    connections. `timeout` is checked between reads, so an answer that trickles may overrun it by one pause.
    """

    def _open(self) -> None:
        if direct(self.url):
            from lichen_client.lanes import Lanes

            self._lanes = Lanes(self.url, self._connections, CONNECT_TIMEOUT)
            return
        import httpx2

        self._http = httpx2.Client(**self._arguments())

    def run(
        self,
        operation: str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **values: Any,
    ) -> Result:
        """Runs an operation and returns its result.

        image: the operation's first input: an array (height, width[, channels]), a picture of Pillow's, the bytes of an
            encoded image, a path to one, or an `Asset`. Further inputs are keywords holding any of these, paths as
            `pathlib.Path`; or `images` has all of them by name.
        format: name of the format to get the encoded image in, such as "png"; without it the result is an array.
        values: the operation's parameters and knobs, and the service's own: method, max_error, max_ms, device,
            nonfinite, space, storage ...

        Raises `StatusError` (what the service says against it), `ConnectionFailed`, or OSError for an unreadable path.
        """
        call = calls.run_call(operation, image, values, images=images, format=format)
        result = calls.read_result(self._converse(call))
        return result.planned(partial(self.explain, operation, image, images=images, format=format, **values))

    def explain(
        self,
        operation: str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **values: Any,
    ) -> dict[str, Any]:
        """The plan the service would follow for the same `run`, and why; no pixel is computed."""
        return self._document(calls.run_call(operation, image, values, images=images, format=format, explain=True))

    def find(
        self,
        operation: str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        **values: Any,
    ) -> dict[str, Any]:
        """What an operation such as `statistics` reports beside pixels, without the pixels."""
        call = calls.run_call(operation, image, values, images=images, format=None, accept="application/json")
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
        said, given = calls.settled(pipeline, images)
        call = calls.pipeline_call(said, image, given, wishes, format=format)
        results = calls.read_results(self._converse(call))
        return results.planned(partial(self.explain_pipeline, said, image, images=given, format=format, **wishes))

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
        scene: Scene | Mapping[str, Any] | str,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> Result:
        """The picture of a scene (`Scene`, mapping or JSON), with the buffers it names in `images`. Raises as `run`."""
        said, given = calls.settled(scene, images)
        call = calls.scene_call(said, given, wishes, format=format)
        result = calls.read_result(self._converse(call))
        return result.planned(partial(self.explain_scene, said, images=given, format=format, **wishes))

    def explain_scene(
        self,
        scene: Scene | Mapping[str, Any] | str,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> dict[str, Any]:
        """Which effects of a scene would run, and why the others would not; no pixel is computed."""
        call = calls.scene_call(scene, images, wishes, format=format, explain=True)
        return self._document(call)

    # ------------------------------------------------------------------------------------------- jobs and stored images

    def submit(
        self,
        operation: str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **values: Any,
    ) -> Job:
        """Asks for what `run` would give and does not wait for it."""
        call = calls.run_call(operation, image, values, images=images, format=format)
        return self._submitted(call, partial(self.explain, operation, image, images=images, format=format, **values))

    def submit_pipeline(
        self,
        pipeline: Pipeline | Mapping[str, Any] | str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> Job:
        """Asks for what `run_pipeline` would give and does not wait for it."""
        said, given = calls.settled(pipeline, images)
        call = calls.pipeline_call(said, image, given, wishes, format=format)
        return self._submitted(call, partial(self.explain_pipeline, said, image, images=given, format=format, **wishes))

    def submit_scene(
        self,
        scene: Scene | Mapping[str, Any] | str,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> Job:
        """Asks for what `render` would give and does not wait for it."""
        said, given = calls.settled(scene, images)
        call = calls.scene_call(said, given, wishes, format=format)
        return self._submitted(call, partial(self.explain_scene, said, images=given, format=format, **wishes))

    def job(self, id: str) -> Job:
        """A job by its id, as another process may have made it; its result does not know where it came from."""
        return Job(self, id)

    def store(self, image: ImageLike) -> Asset:
        """Lets the service keep an image, so that many calls may read it and it is sent once."""
        return calls.read_asset(self._converse(calls.asset_call(image)))

    # -------------------------------------------------------------------------------------------------------- documents

    def operations(self) -> dict[str, Any]:
        """What the service can do: the document of /v1/operations."""
        return self._document(calls.get_call("v1", "operations"))

    def operation(self, name: str) -> dict[str, Any]:
        """One operation: parameters with ranges and units, inputs, methods, limits."""
        return self._document(calls.get_call("v1", "operations", name))

    def version(self) -> dict[str, Any]:
        """Versions of the service and of what it stands on."""
        return self._document(calls.get_call("v1", "version"))

    @property
    def with_raw_response(self) -> Raw[Reply]:
        """The same calls, answered with status, header fields and bytes as they came, refusals too."""
        return Raw(self._converse)

    @property
    def with_streaming_response(self) -> Raw[AbstractContextManager[Stream]]:
        """The same calls for `with`: answers whose bytes are read piece by piece. Refusals are raised."""
        return Raw(self._streamed)

    def close(self) -> None:
        if self._shared:
            return
        (self._inside or self._lanes or self._http).close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _submitted(self, call: Call, plan: Callable[[], Any]) -> Job:
        return Job(self, str(self._document(calls.as_job(call))["id"]), plan)

    def _document(self, call: Call) -> dict[str, Any]:
        return calls.read_json(self._converse(call))

    @contextmanager
    def _streamed(self, call: Call) -> Iterator[Stream]:
        with ExitStack() as open:
            pieces: Iterator[bytes] = iter(())

            def begin(call: Call, deadline: float) -> Reply:
                nonlocal pieces
                open.close()  # what an earlier try has left
                reply, pieces = self._begun(call, deadline, open)
                return reply

            reply = self._converse(call, begin)
            if not 200 <= reply.status < 300:
                calls.require_success(replace(reply, body=bytearray(b"".join(pieces))))
            yield Stream(reply.status, reply.headers, pieces)

    def _begun(self, call: Call, deadline: float, open: ExitStack) -> tuple[Reply, Iterator[bytes]]:
        """An answer whose head has come, and its body, which is read while `open` is."""
        if self._inside is not None:
            reply = self._answer_here(call, deadline)
            return reply, cut(reply.body)
        import httpx2

        def pieces() -> Iterator[bytes]:
            with failures(call, self.url):
                for piece in response.iter_bytes(PIECE):
                    yield piece
                    if time.monotonic() > deadline:
                        raise TimeoutError

        with failures(call, self.url):
            http = self._http if self._lanes is None else open.enter_context(httpx2.Client(**self._arguments()))
            response = open.enter_context(http.stream(**self._request(call, deadline)))
        return reply_of(response, bytearray()), pieces()

    def _converse(self, call: Call, send: Callable[[Call, float], Reply] | None = None) -> Reply:
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
                    outcome = (send or self._send)(call, step.deadline)
                except ConnectionFailed as failure:
                    outcome = failure
        except StopIteration as end:
            reply: Reply = end.value
            return reply

    def _send(self, call: Call, deadline: float) -> Reply:
        if self._inside is not None:
            return self._answer_here(call, deadline)
        if self._lanes is not None:
            with failures(call, self.url):
                headers = {**self._headers, **call.headers, **left_of(deadline)}
                pieces = call.body[1] if call.parts else None
                return self._lanes.exchange(call.method, call.target, headers, pieces, deadline)
        body = bytearray()
        with failures(call, self.url), self._http.stream(**self._request(call, deadline)) as response:
            for piece in response.iter_bytes():
                body += piece
                if time.monotonic() > deadline:
                    raise TimeoutError
            return reply_of(response, body)


class Job:
    """Work that the service does in the background. May be asked from any thread."""

    def __init__(self, client: Client, id: str, plan: Callable[[], Any] | None = None) -> None:
        self._client, self._plan = client, plan
        self.id = id

    def __repr__(self) -> str:
        return f"Job({self.id!r})"

    def state(self) -> State:
        """Where it is now."""
        return jobs.State.read(self._client._document(calls.get_call("v1", "jobs", self.id)))

    def wait(self, timeout: float | None = None, *, progress: Progress = False) -> State:
        """Waits for its end. `progress` is called with per cent and stage at every look; True draws a bar.

        Raises `TimedOut` after `timeout` seconds; the job goes on.
        """
        until = None if timeout is None else time.monotonic() + timeout
        tell, pause = jobs.teller(progress), jobs.looks()
        while True:
            state = self.state()
            tell(state)
            if state.ended:
                return state
            seconds = pause()
            if until is not None and time.monotonic() + seconds > until:
                raise TimedOut(f"job {self.id} has not ended within {timeout:g} s")
            time.sleep(seconds)

    def result(self, timeout: float | None = None, *, progress: Progress = False) -> Result | Results:
        """What it made, when it has ended; of a pipeline with several outputs the `Results`.

        Raises what the call would have raised, `Dismissed` for a job that was given up, and as `wait`.
        """
        if self.wait(timeout, progress=progress).status == "dismissed":
            raise jobs.Dismissed(f"job {self.id} was dismissed")
        return calls.read_any(self._client._converse(calls.result_call(self.id))).planned(self._plan)

    def dismiss(self) -> None:
        """Gives it up, or, where it has ended, lets the service forget it."""
        reply = self._client._converse(calls.delete_call("v1", "jobs", self.id))
        calls.require_success(reply)
