"""GET /metrics: figures of the whole service, for Prometheus."""

from __future__ import annotations

from lichen_service.http.message import Request, Response
from lichen_service.metrics import MEDIA_TYPE, Metrics


class Figures:
    def __init__(self, metrics: Metrics) -> None:
        self._metrics = metrics

    def text(self, request: Request, name: str) -> Response:
        return Response(200, self._metrics.text(), {"Content-Type": MEDIA_TYPE, "Cache-Control": "no-store"})
