"""The asynchronous client: a thin transport under the rules of `calls` and `retry`."""

from __future__ import annotations

import asyncio
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


class AsyncClient(Transport):
    """`Client` for asyncio: the same methods, to be awaited. Belongs to the event loop that first uses it."""

    def _open(self) -> None:
        import httpx2

        self._http = httpx2.AsyncClient(**self._arguments())

    async def run(
        self, operation: str, image: ImageLike = None, /, *, format: str | None = None, **values: Any
    ) -> Result:
        """As `Client.run`."""
        call = await asyncio.to_thread(calls.run_call, operation, image, values, format=format)
        return calls.read_result(await self._converse(call))

    async def explain(
        self, operation: str, image: ImageLike = None, /, *, format: str | None = None, **values: Any
    ) -> dict[str, Any]:
        """As `Client.explain`."""
        call = await asyncio.to_thread(calls.run_call, operation, image, values, format=format, explain=True)
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
        call = await asyncio.to_thread(calls.pipeline_call, pipeline, image, images, wishes, format=format)
        return calls.read_results(await self._converse(call))

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
        scene: Mapping[str, Any] | str,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> Result:
        """As `Client.render`."""
        call = await asyncio.to_thread(calls.scene_call, scene, images, wishes, format=format)
        return calls.read_result(await self._converse(call))

    async def explain_scene(
        self,
        scene: Mapping[str, Any] | str,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> dict[str, Any]:
        """As `Client.explain_scene`."""
        call = await asyncio.to_thread(calls.scene_call, scene, images, wishes, format=format, explain=True)
        return await self._document(call)

    async def operations(self) -> dict[str, Any]:
        """As `Client.operations`."""
        return await self._document(calls.get_call("v1", "operations"))

    async def operation(self, name: str) -> dict[str, Any]:
        """As `Client.operation`."""
        return await self._document(calls.get_call("v1", "operations", name))

    async def version(self) -> dict[str, Any]:
        """As `Client.version`."""
        return await self._document(calls.get_call("v1", "version"))

    async def close(self) -> None:
        await self._http.aclose()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *exception: object) -> None:
        await self.close()

    async def _document(self, call: Call) -> dict[str, Any]:
        return calls.read_json(await self._converse(call))

    async def _converse(self, call: Call) -> Reply:
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
                    outcome = await self._send(call, step.deadline)
                except ConnectionFailed as failure:
                    outcome = failure
        except StopIteration as end:
            reply: Reply = end.value
            return reply

    async def _send(self, call: Call, deadline: float) -> Reply:
        body = bytearray()
        left = max(deadline - time.monotonic(), 1e-3)
        with failures(call, self.url):
            async with asyncio.timeout(left), self._http.stream(**self._request(call, deadline)) as response:
                async for piece in response.aiter_bytes():
                    body += piece
                return reply_of(response, body)
