"""Figures for Prometheus, summed over all worker processes.

Workers count into files that they map (the client library's multi-process mode), in the folder that the service's
workers share; whichever worker is asked adds them up. What is gauged rather than counted is asked for then.

Every label has few values: paths are those of the routing table, operations those of the catalogue, methods without
their knobs, stages those of `Server-Timing`. What a client can make up becomes `other`.
"""

from __future__ import annotations

import contextlib
import os
from bisect import bisect_left
from collections import Counter as Counts
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from prometheus_client.metrics_core import GaugeMetricFamily, Metric
from prometheus_client.multiprocess import MultiProcessCollector

from lichen_service.settings import FIGURES
from lichen_service.stages import ORDER

MEDIA_TYPE = "text/plain; version=1.0.0; charset=utf-8"
OTHER = "other"
_SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60)
_METHODS = frozenset(("GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS", "PATCH", "QUERY"))

Asked = Callable[[], Mapping[str, float]]


class Metrics:
    def __init__(self, known: Callable[[str], object]) -> None:
        """`known` says whether there is an operation of a name."""
        self.routes: frozenset[str] = frozenset()
        """templates of paths"""
        self._known = known
        self._asked: list[tuple[str, str, str, Asked]] = []
        own = self._own = CollectorRegistry()
        self._requests = Counter("lichen_requests", "answers", ("route", "method", "status"), registry=own)
        self._problems = Counter("lichen_problems", "problem documents", ("code",), registry=own)
        self._seconds = Histogram(
            "lichen_request_seconds",
            "from the head to the last byte of the answer",
            ("route",),
            registry=own,
            buckets=_SECONDS,
        )
        self._queue = Histogram("lichen_queue_seconds", "waiting for a thread", registry=own, buckets=_SECONDS)
        self._stages = Histogram(
            "lichen_stage_seconds", "by stage of a run", ("stage",), registry=own, buckets=_SECONDS
        )
        self._runs = Counter("lichen_runs", "operations that ran", ("operation", "method", "device"), registry=own)
        self._pixels = Counter("lichen_pixels", "pixels of the inputs of runs", registry=own)
        self._skipped = Counter("lichen_runs_with_skipped_work", "runs in which work was left out", registry=own)
        self._results = Counter(
            "lichen_results", "results, by whether another request had made them", ("kept",), registry=own
        )
        self._received = Counter("lichen_received_bytes", "bytes of request bodies", registry=own)
        self._sent = Counter("lichen_sent_bytes", "bytes of answers", registry=own)
        self.decoders_died = Counter("lichen_decoders_died", "decoders that ended on an image", registry=own)
        self._held = Gauge(
            "lichen_image_bytes", "memory reserved for images", registry=own, multiprocess_mode="livesum"
        )

    def ask(self, name: str, says: str, label: str, asked: Asked) -> None:
        """Adds a gauge of the whole service, of which one worker knows everything: its values by label."""
        self._asked.append((name, says, label, asked))

    def answered(self, lines: Iterable[Mapping[str, Any]]) -> None:
        """Counts answers, from their lines in the access log; equal ones together, since each figure is a file's."""
        seconds: defaultdict[tuple[str, str, int], list[float]] = defaultdict(list)
        problems: Counts[str] = Counts()
        received = sent = 0
        for line in lines:
            route, method = line.get("route", OTHER), line.get("method", "")
            route = route if route in self.routes else OTHER
            seconds[route, method if method in _METHODS else OTHER, line["status"]].append(line["total_ms"] / 1e3)
            received += line["bytes_in"]
            sent += line["bytes_out"]
            if "queue_ms" in line:
                self._queue.observe(line["queue_ms"] / 1e3)
            if "kept" in line:
                self._results.labels("yes" if line["kept"] else "no").inc()
            if "problem" in line:
                problems[line["problem"]] += 1
            if "operation" in line and self._known(line["operation"]):
                self._ran(line)
        for problem, count in problems.items():
            self._problems.labels(problem).inc(count)
        for (route, method, status), each in seconds.items():
            self._requests.labels(route, method, str(status)).inc(len(each))
            _observe(self._seconds.labels(route), each)
        self._received.inc(received)
        self._sent.inc(sent)

    def held(self, count: int) -> None:
        """Bytes that this process has reserved for images."""
        self._held.set(count)

    def _ran(self, line: Mapping[str, Any]) -> None:
        method = str(line.get("method_used", "")).partition(";")[0]
        self._runs.labels(line["operation"], method, line.get("device", "")).inc()
        self._pixels.inc(line.get("pixels", 0))
        if line.get("skipped"):
            self._skipped.inc()
        for stage, milliseconds in line.get("stages_ms", {}).items():
            if stage in ORDER:
                self._stages.labels(stage).observe(milliseconds / 1e3)

    def text(self) -> bytes:
        """All figures in Prometheus's text format."""
        folder = os.environ.get(FIGURES)
        registry = self._own
        if folder:
            _drop_gauges_of_the_dead(Path(folder))
            registry = CollectorRegistry()
            MultiProcessCollector(registry, folder)  # type: ignore[no-untyped-call]
        asked = CollectorRegistry()
        asked.register(self)
        return generate_latest(registry) + generate_latest(asked)

    def collect(self) -> Iterator[Metric]:
        """What is asked for at this moment; for the client library."""
        for name, says, label, asked in self._asked:
            family = GaugeMetricFamily(name, says, labels=[label])
            for value, count in asked().items():
                family.add_metric([value], count)
            yield family


def _observe(histogram: Histogram, values: Sequence[float]) -> None:
    """`histogram.observe` of each value, with one write for each bucket; the client library has no such call."""
    counts = Counts(bisect_left(_SECONDS, each) for each in values)
    histogram._sum.inc(sum(values))
    for at, count in counts.items():
        histogram._buckets[at].inc(count)


def _drop_gauges_of_the_dead(folder: Path) -> None:
    """A process that was killed no longer holds what it held; what it counted stays counted."""
    for path in folder.glob("gauge_live*.db"):
        pid = path.stem.rpartition("_")[2]
        if pid.isdigit() and not Path(f"/proc/{pid}").exists():
            with contextlib.suppress(OSError):
                path.unlink()
