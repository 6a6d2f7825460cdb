"""The asynchronous client: a thin transport under the rules of `calls` and `retry`."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Mapping
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
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
from lichen_client.streams import PIECE, AsyncStream, cut
from lichen_client.transport import Transport, failures, reply_of

if TYPE_CHECKING:
    from lichen_client.calls import ImageLike
    from lichen_client.jobs import Progress, State
    from lichen_client.pipeline import Pipeline
    from lichen_client.scene import Scene


class AsyncClient(Transport, Operations[Coroutine[Any, Any, Result]]):
    """`Client` for asyncio: the same methods, to be awaited. Belongs to the event loop that first uses it."""

    def _open(self) -> None:
        import httpx2

        self._http = httpx2.AsyncClient(**self._arguments())

    async def run(
        self,
        operation: str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **values: Any,
    ) -> Result:
        """As `Client.run`."""
        call = await asyncio.to_thread(calls.run_call, operation, image, values, images=images, format=format)
        result = calls.read_result(await self._converse(call))
        return result.planned(partial(self.explain, operation, image, images=images, format=format, **values))

    async def explain(
        self,
        operation: str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **values: Any,
    ) -> dict[str, Any]:
        """As `Client.explain`."""
        call = await asyncio.to_thread(
            calls.run_call, operation, image, values, images=images, format=format, explain=True
        )
        return await self._document(call)

    async def find(
        self,
        operation: str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        **values: Any,
    ) -> dict[str, Any]:
        """As `Client.find`."""
        json = "application/json"
        call = await asyncio.to_thread(
            calls.run_call, operation, image, values, images=images, format=None, accept=json
        )
        return await self._document(call)

    async def run_pipeline(
        self,
        pipeline: Pipeline | Mapping[str, Any] | str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> Results:
        """As `Client.run_pipeline`."""
        said, given = calls.settled(pipeline, images)
        call = await asyncio.to_thread(calls.pipeline_call, said, image, given, wishes, format=format)
        results = calls.read_results(await self._converse(call))
        return results.planned(partial(self.explain_pipeline, said, image, images=given, format=format, **wishes))

    async def explain_pipeline(
        self,
        pipeline: Pipeline | Mapping[str, Any] | str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> dict[str, Any]:
        """As `Client.explain_pipeline`."""
        call = await asyncio.to_thread(
            calls.pipeline_call, pipeline, image, images, wishes, format=format, explain=True
        )
        return await self._document(call)

    async def render(
        self,
        scene: Scene | Mapping[str, Any] | str,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> Result:
        """As `Client.render`."""
        said, given = calls.settled(scene, images)
        call = await asyncio.to_thread(calls.scene_call, said, given, wishes, format=format)
        result = calls.read_result(await self._converse(call))
        return result.planned(partial(self.explain_scene, said, images=given, format=format, **wishes))

    async def explain_scene(
        self,
        scene: Scene | Mapping[str, Any] | str,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> dict[str, Any]:
        """As `Client.explain_scene`."""
        call = await asyncio.to_thread(calls.scene_call, scene, images, wishes, format=format, explain=True)
        return await self._document(call)

    async def submit(
        self,
        operation: str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **values: Any,
    ) -> AsyncJob:
        """As `Client.submit`."""
        call = await asyncio.to_thread(calls.run_call, operation, image, values, images=images, format=format)
        plan = partial(self.explain, operation, image, images=images, format=format, **values)
        return await self._submitted(call, plan)

    async def submit_pipeline(
        self,
        pipeline: Pipeline | Mapping[str, Any] | str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> AsyncJob:
        """As `Client.submit_pipeline`."""
        said, given = calls.settled(pipeline, images)
        call = await asyncio.to_thread(calls.pipeline_call, said, image, given, wishes, format=format)
        plan = partial(self.explain_pipeline, said, image, images=given, format=format, **wishes)
        return await self._submitted(call, plan)

    async def submit_scene(
        self,
        scene: Scene | Mapping[str, Any] | str,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> AsyncJob:
        """As `Client.submit_scene`."""
        said, given = calls.settled(scene, images)
        call = await asyncio.to_thread(calls.scene_call, said, given, wishes, format=format)
        return await self._submitted(call, partial(self.explain_scene, said, images=given, format=format, **wishes))

    def job(self, id: str) -> AsyncJob:
        """As `Client.job`; asks nobody."""
        return AsyncJob(self, id)

    async def store(self, image: ImageLike) -> Asset:
        """As `Client.store`."""
        return calls.read_asset(await self._converse(await asyncio.to_thread(calls.asset_call, image)))

    async def operations(self) -> dict[str, Any]:
        """As `Client.operations`."""
        return await self._document(calls.get_call("v1", "operations"))

    async def operation(self, name: str) -> dict[str, Any]:
        """As `Client.operation`."""
        return await self._document(calls.get_call("v1", "operations", name))

    async def version(self) -> dict[str, Any]:
        """As `Client.version`."""
        return await self._document(calls.get_call("v1", "version"))

    @property
    def with_raw_response(self) -> Raw[Coroutine[Any, Any, Reply]]:
        """As `Client.with_raw_response`."""
        return Raw(self._converse)

    @property
    def with_streaming_response(self) -> Raw[AbstractAsyncContextManager[AsyncStream]]:
        """As `Client.with_streaming_response`, for `async with`."""
        return Raw(self._streamed)

    async def close(self) -> None:
        if self._shared:
            return
        if self._inside is not None:
            await asyncio.to_thread(self._inside.close)
        else:
            await self._http.aclose()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exception: object) -> None:
        await self.close()

    async def _submitted(self, call: Call, plan: Callable[[], Any]) -> AsyncJob:
        return AsyncJob(self, str((await self._document(calls.as_job(call)))["id"]), plan)

    async def _document(self, call: Call) -> dict[str, Any]:
        return calls.read_json(await self._converse(call))

    @asynccontextmanager
    async def _streamed(self, call: Call) -> AsyncIterator[AsyncStream]:
        async with AsyncExitStack() as open:
            pieces: AsyncIterator[bytes] | None = None

            async def begin(call: Call, deadline: float) -> Reply:
                nonlocal pieces
                await open.aclose()  # what an earlier try has left
                reply, pieces = await self._begun(call, deadline, open)
                return reply

            reply = await self._converse(call, begin)
            assert pieces is not None, "an answer has begun"
            if not 200 <= reply.status < 300:
                calls.require_success(replace(reply, body=bytearray(b"".join([each async for each in pieces]))))
            yield AsyncStream(reply.status, reply.headers, pieces)

    async def _begun(self, call: Call, deadline: float, open: AsyncExitStack) -> tuple[Reply, AsyncIterator[bytes]]:
        """An answer whose head has come, and its body, which is read while `open` is."""
        if self._inside is not None:
            reply = await asyncio.to_thread(self._answer_here, call, deadline)
            return reply, _cut(reply.body)

        async def pieces() -> AsyncIterator[bytes]:
            with failures(call, self.url):
                async for piece in response.aiter_bytes(PIECE):
                    yield piece
                    if time.monotonic() > deadline:
                        raise TimeoutError

        with failures(call, self.url):
            async with asyncio.timeout(max(deadline - time.monotonic(), 1e-3)):
                response = await open.enter_async_context(self._http.stream(**self._request(call, deadline)))
        return reply_of(response, bytearray()), pieces()

    async def _converse(self, call: Call, send: Callable[[Call, float], Awaitable[Reply]] | None = None) -> Reply:
        steps = conversation(self.timeout, self.retries)
        outcome: Reply | ConnectionFailed | None = None
        try:
            while True:
                step = steps.send(outcome)
                if isinstance(step, Wait):
                    await asyncio.sleep(step.seconds)
                    outcome = None
                    continue
                try:
                    outcome = await (send or self._send)(call, step.deadline)
                except ConnectionFailed as failure:
                    outcome = failure
        except StopIteration as end:
            reply: Reply = end.value
            return reply

    async def _send(self, call: Call, deadline: float) -> Reply:
        if self._inside is not None:
            return await asyncio.to_thread(self._answer_here, call, deadline)
        body = bytearray()
        left = max(deadline - time.monotonic(), 1e-3)
        with failures(call, self.url):
            async with asyncio.timeout(left), self._http.stream(**self._request(call, deadline)) as response:
                async for piece in response.aiter_bytes():
                    body += piece
                return reply_of(response, body)


async def _cut(body: bytearray) -> AsyncIterator[bytes]:
    for piece in cut(body):
        yield piece


class AsyncJob:
    """`Job` for asyncio."""

    def __init__(self, client: AsyncClient, id: str, plan: Callable[[], Any] | None = None) -> None:
        self._client, self._plan = client, plan
        self.id = id

    def __repr__(self) -> str:
        return f"AsyncJob({self.id!r})"

    async def state(self) -> State:
        """As `Job.state`."""
        return jobs.State.read(await self._client._document(calls.get_call("v1", "jobs", self.id)))

    async def wait(self, timeout: float | None = None, *, progress: Progress = False) -> State:
        """As `Job.wait`."""
        until = None if timeout is None else time.monotonic() + timeout
        tell, pause = jobs.teller(progress), jobs.looks()
        while True:
            state = await self.state()
            tell(state)
            if state.ended:
                return state
            seconds = pause()
            if until is not None and time.monotonic() + seconds > until:
                raise TimedOut(f"job {self.id} has not ended within {timeout:g} s")
            await asyncio.sleep(seconds)

    async def result(self, timeout: float | None = None, *, progress: Progress = False) -> Result | Results:
        """As `Job.result`."""
        if (await self.wait(timeout, progress=progress)).status == "dismissed":
            raise jobs.Dismissed(f"job {self.id} was dismissed")
        return calls.read_any(await self._client._converse(calls.result_call(self.id))).planned(self._plan)

    async def dismiss(self) -> None:
        """As `Job.dismiss`."""
        calls.require_success(await self._client._converse(calls.delete_call("v1", "jobs", self.id)))
