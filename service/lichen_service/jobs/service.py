"""Jobs put together: the queue, the threads that work it off, and the paths under which clients see them."""

from __future__ import annotations

from collections.abc import Callable

from lichen_service import strict_json
from lichen_service.assets import Assets
from lichen_service.http.message import Head, Request, Response
from lichen_service.jobs.job import PATH, Stored
from lichen_service.jobs.queue import Queue
from lichen_service.jobs.runner import Runner
from lichen_service.routes.jobs import JobRoutes, order_of
from lichen_service.routing import Route
from lichen_service.settings import Settings

JSON = "application/json"
SCHEME = "dask://"
"""How a setting begins that names the scheduler of a cluster."""


class Jobs:
    def __init__(
        self,
        settings: Settings,
        assets: Assets,
        handle: Callable[[Request], Response],
        check: Callable[[Request], None],
    ) -> None:
        """`check` raises all that can be seen to be wrong with a run before it is one."""
        self.queue = Queue(settings.data_folder / "jobs", assets)
        if settings.jobs.startswith(SCHEME):
            from lichen_service.jobs.cluster import Cluster

            handle = Cluster(settings, assets).handle
        self.runner = Runner(
            self.queue, handle, threads=settings.job_threads, timeout=settings.job_timeout, keep=settings.job_ttl
        )
        self.routes = JobRoutes(settings, self.queue, self.runner)
        self._check = check
        own = f"{PATH}/{{name}}"
        self.table = (
            Route(PATH, {"GET": self.routes.list, "POST": self._post}, True, (JSON,), scope="jobs"),
            Route(own, {"GET": self.routes.one, "DELETE": self.routes.dismiss}, scope="jobs"),
            Route(f"{own}/events", {"GET": self.routes.events}, scope="jobs"),
            Route(f"{own}/result", {"GET": self.routes.result}, scope="jobs"),
        )

    def _post(self, request: Request, name: str) -> Response:
        """A job that comes as JSON, its inputs among the stored images."""
        order = order_of(strict_json.read(request.body))
        head = request.head
        kept = {"accept": head.headers["accept"]} if "accept" in head.headers else {}
        if order.body:
            kept["content-type"] = JSON
        stored = Stored("POST", order.path, order.query, kept, head.request_id)
        run = Head("POST", order.path, order.query, kept, head.request_id, head.received, head.deadline)
        self._check(Request(run, order.body))
        return self.routes.accept(request, stored, order.body)
