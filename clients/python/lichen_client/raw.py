"""Answers as they came: what `with_raw_response` of both clients gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from lichen_client import calls
from lichen_client.operations import Operations

if TYPE_CHECKING:
    from lichen_client.calls import Call, ImageLike
    from lichen_client.pipeline import Pipeline
    from lichen_client.scene import Scene

A = TypeVar("A", covariant=True)


class Raw(Operations[A]):
    """A client's calls, operations by their names too, answered with a `Reply` or, of an `AsyncClient`, with one that
    is awaited."""

    def __init__(self, converse: Callable[[Call], A]) -> None:
        self._converse = converse

    def run(
        self,
        operation: str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **values: Any,
    ) -> A:
        """As `Client.run`."""
        return self._converse(calls.run_call(operation, image, values, images=images, format=format, accept="*/*"))

    def run_pipeline(
        self,
        pipeline: Pipeline | Mapping[str, Any] | str,
        image: ImageLike = None,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> A:
        """As `Client.run_pipeline`."""
        return self._converse(calls.pipeline_call(pipeline, image, images, wishes, format=format))

    def render(
        self,
        scene: Scene | Mapping[str, Any] | str,
        /,
        *,
        images: Mapping[str, ImageLike] | None = None,
        format: str | None = None,
        **wishes: Any,
    ) -> A:
        """As `Client.render`."""
        return self._converse(calls.scene_call(scene, images, wishes, format=format))

    def get(self, *path: str) -> A:
        """What lies at a path: `get("v1", "limits")`."""
        return self._converse(calls.get_call(*path))
