"""The plot of a report: error across, time up, a line for each method, what one more digit costs along the top.

Errors fall to the right, so a step to the right is one more digit and a step down is time saved. Filled marks are worst
cases, hollow ones typical errors; a mark that is pale is dominated. The broad pale line is the Pareto front without its
steps that nobody has a reason to take. Nothing is left out: settings that failed are crosses in the corner with the
reason beside them, an error of zero stands at the right edge.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from lichen.calibration.chart import Labels, Scale, apart, nearest, spanning, wrapped
from lichen.calibration.drawing import HUES, Area, Dot, Drawing, Form, Line, Shape, Text
from lichen.calibration.panel import panel
from lichen.calibration.report import Report, Setting, Verdict
from lichen.calibration.words import DOUBLES, PLAIN, milliseconds, scientific, short

WIDTH = 960
LEFT, RIGHT = 70.0, WIDTH - 30.0
HEIGHT = 360.0
"""of the frame"""
NEAR, FAR = 11.0, (22.0, 34.0, 48.0, 64.0, 84.0)
"""How far a name stays from the middle of its mark, px, and how far where there is no place."""
SHAPES: Mapping[str, Form] = {
    "float16": "diamond",
    "fixed8": "square",
    "fixed12": "square",
    "fixed16": "square",
    "float64": "triangle",
}


def plot(report: Report) -> Drawing:
    """The report as a drawing."""
    return _Plot(report).drawing()


@dataclass(frozen=True, eq=False)
class _Plot:
    report: Report

    @cached_property
    def head(self) -> list[Text]:
        y, lines = 38.0, []
        for line in wrapped(self.report.title, WIDTH - 48, 21, bold=True):
            lines.append(Text(LEFT - 46, y, line, size=21, bold=True))
            y += 26
        for text, role in ((self.report.headline, "ink"), (self.report.remark, "muted")):
            for line in wrapped(text, WIDTH - 48, 14):
                lines.append(Text(LEFT - 46, y, line, role, 14))
                y += 19
        return lines

    @cached_property
    def top(self) -> float:
        """of the frame; the prices stand above it"""
        return self.head[-1].y + (98 if self._priced else 24)

    @property
    def _priced(self) -> bool:
        return bool(self.report.prices)

    @property
    def bottom(self) -> float:
        return self.top + HEIGHT

    @cached_property
    def shown(self) -> list[tuple[Setting, Verdict]]:
        """Settings with numbers: all of our own and the peers, and of other precisions what is worth its time."""
        pairs = list(zip(self.report.settings, self.report.verdicts, strict=True))
        return [pair for pair in pairs if pair[0].failed is None]

    @cached_property
    def x(self) -> Scale:
        errors = [error for setting, _ in self.shown for error in (setting.worst, setting.typical)]
        scale = spanning(errors, RIGHT - 14, LEFT + 14, least=1.0, margin=0.12)
        if any(error == 0 for error in errors):
            return Scale(scale.low / 3, scale.high, scale.start, scale.end)
        return scale

    @cached_property
    def y(self) -> Scale:
        times = [setting.seconds * 1e3 for setting, _ in self.shown if setting.precision != DOUBLES]
        return spanning(times, self.bottom - 10, self.top + 10 + 20 * len(self.failures), least=1.0, margin=0.14)

    @cached_property
    def failures(self) -> list[tuple[str, str, str]]:
        """Method, its settings and the reason, for all settings that failed for one reason."""
        found: dict[tuple[str, str], list[str]] = {}
        for each in self.report.settings:
            if each.failed is not None:
                of = each.precision if each.precision != PLAIN else "" if each.knob is None else short(each.knob)
                found.setdefault((each.method, each.failed), []).append(of)
        return [(method, ", ".join(filter(None, values)), reason) for (method, reason), values in found.items()]

    def across(self, error: float) -> float:
        return self.x(error) if error > 0 else RIGHT - 8

    def up(self, setting: Setting) -> float:
        """The definition in doubles takes so long that it may lie beyond: then it stands at the upper edge."""
        return max(self.y(setting.seconds * 1e3), self.top + 8)

    def error(self, setting: Setting) -> float:
        return setting.worst if self.report.ranking == "worst" else setting.typical

    @cached_property
    def methods(self) -> list[str]:
        """Our own, in the order of their hues."""
        return list(dict.fromkeys(each.method for each in self.report.settings if not each.peer))

    def hue(self, method: str) -> str:
        return HUES[self.methods.index(method) % len(HUES)] if method in self.methods else "peer"

    # ------------------------------------------------------------------------------------------------------ the whole

    def drawing(self) -> Drawing:
        caption, height = self._caption()
        shapes: list[Shape] = [*self.head, *self._frame(), *self._prices(), *self._front(), *self._lines()]
        dots = list(self._dots())
        labels = Labels((LEFT, self.top, RIGHT, self.bottom), ((dot.x, dot.y, dot.radius + 1) for dot in dots))
        failed = self._failed(labels)
        leading = list(self._label(labels))
        shapes += [*leading, *dots, *failed, *labels.placed, *caption]
        if self.report.study:
            below, end = panel(self.report.study, LEFT, RIGHT, float(height), self.methods)
            shapes, height = [*shapes, *below], round(end + 22)
        title = f"{self.report.title}: what accuracy costs in time"
        return Drawing(WIDTH, height, title, f"{self.report.headline} {self.report.remark}".strip(), tuple(shapes))

    def _frame(self) -> Iterable[Shape]:
        yield Area([(LEFT, self.top), (RIGHT, self.top), (RIGHT, self.bottom), (LEFT, self.bottom)], "panel")
        narrow = self.x.decades < 2.2
        ticks = self.x.ticks((1, 2, 5) if narrow else (1,))
        told = [Text(self.x(error), self.bottom + 17, short(error), "muted", 12, "middle") for error in ticks]
        if any(self.error(setting) == 0 for setting, _ in self.shown):
            told.insert(0, Text(RIGHT, self.bottom + 17, "exact", "muted", 12, "end"))
        yield from apart(told)
        yield from (Line([(self.x(error), self.top), (self.x(error), self.bottom)], "grid") for error in ticks)
        for time in self.y.ticks((1, 2, 5)):
            at = self.y(time)
            whole = math.log10(time) % 1 == 0
            if whole or self.y.decades < 2.6:
                yield Text(
                    LEFT - 8, at + 4, f"{time:g} ms" if time < 1000 else f"{time / 1000:g} s", "muted", 12, "end"
                )
            yield Line([(LEFT, at), (RIGHT, at)], "grid", 1.0 if whole else 0.5)
        unit = "error, in output units; further right is more accurate" + ("" if narrow else ", a digit for each line")
        unit += "; up: time"
        yield Text((LEFT + RIGHT) / 2, self.bottom + 38, unit, "muted", 12, "middle")

    def _prices(self) -> Iterable[Shape]:
        """Along the top: the least time for each round error, and what it adds to the one before."""
        prices = [price for price in self.report.prices if price.index is not None]
        if not self._priced:
            return
        y, before = self.top - 14, None
        kind = "an" if self.report.ranking == "worst" else "a typical"
        yield Text(LEFT - 46, y - 54, f"least time for {kind} error of at most ...", "muted", 12)
        last = -math.inf
        for price in prices:
            at = min(max(self.x(price.error), LEFT + 14), RIGHT - 14)
            setting = self.report.settings[self.report.ours[price.index or 0]]
            time = Text(at, y, milliseconds(price.seconds), self.hue(setting.method), 13, "middle", bold=True)
            if time.box[0] < last + 4:
                continue
            last = time.box[2]
            yield time
            yield Text(at, y - 34, scientific(price.error), "ink", 12, "middle")
            yield Line([(at, self.top - 9), (at, self.top)], "muted", 1)
            if before is not None:
                ratio = price.seconds / before
                added = f"+{(ratio - 1) * 100:.0f} %" if ratio < 1.95 else f"x {ratio:.1f}"
                added = "free" if ratio < 1.005 else added
                yield Text(at, y - 17, added, "muted", 11, "middle")
            before = price.seconds

    def _front(self) -> Iterable[Shape]:
        points = [(self.across(self.error(each)), self.up(each)) for each in self.report.worthwhile]
        if len(points) > 1:
            yield Line(points, "front", 11)

    def _lines(self) -> Iterable[Shape]:
        """One for each method and error; that of the error which ranks is the strong one."""
        for method in dict.fromkeys(setting.method for setting, _ in self.shown if not setting.peer):
            own = [
                each for each, _ in self.shown if each.method == method and each.precision == PLAIN and not each.peer
            ]
            for ranks, of in ((self.report.ranking == "worst", "worst"), (self.report.ranking != "worst", "typical")):
                points = [(self.across(getattr(each, of)), self.up(each)) for each in own]
                style = (1.8, None, 0.85) if ranks else (1.1, (3.0, 3.0), 0.55)
                if len(points) > 1:
                    yield Line(points, self.hue(method), *style)

    def _dots(self) -> Iterable[Dot]:
        for setting, verdict in self.shown:
            title = self._tooltip(setting, verdict)
            pale = verdict.standing in ("dominated", "front") or (verdict.standing == "variant" and verdict.instead)
            hue, y = self.hue(setting.method), self.up(setting)
            shape: Form = "diamond" if setting.peer else SHAPES.get(setting.precision, "circle")
            radius = 5.2 if verdict.standing == "worthwhile" else 3.8
            for hollow, error in ((True, setting.typical), (False, setting.worst)):
                ranks = hollow == (self.report.ranking == "typical")
                opacity = (0.45 if pale else 1.0) * (1.0 if ranks else 0.7)
                yield Dot(
                    self.across(error),
                    y,
                    hue,
                    radius if ranks else 3.0,
                    shape,
                    hollow,
                    opacity,
                    title,
                )

    def _failed(self, labels: Labels) -> list[Shape]:
        """Crosses at the left edge, one for each method and reason, with the reason beside them."""
        shapes: list[Shape] = []
        for number, (method, values, reason) in enumerate(self.failures):
            y = self.top + 18 + 20 * number
            whole = values.count(",") + 1 < sum(each.method == method for each in self.report.settings)
            text = Text(
                LEFT + 24, y + 4, f"{method}{' ' + values if whole else ''}: {reason}", "failed", 11.5, halo="panel"
            )
            title = f"{method}{': ' + values if values else ''}\ncould not run: {reason}"
            shapes += [Dot(LEFT + 12, y, "failed", 4.5, "cross", title=title), text]
            labels.reserve((LEFT, y - 10, text.box[2], y + 10))
        return shapes

    def _label(self, labels: Labels) -> Iterator[Shape]:
        """Methods and peers by name, then knobs: first those worth taking, then as many others as find a place. Gives
        the lines that lead to names which found none beside their mark."""
        shown = [each for each, _ in self.shown if each.peer or each.precision == PLAIN]
        named = set[str]()
        for gap in NEAR, *FAR:
            for setting in sorted(shown, key=self._naming):
                if setting.method not in named:
                    x, y = self.across(self.error(setting)), self.up(setting)
                    role, bold = self.hue(setting.method), not setting.peer
                    if labels.put(x, y, setting.method, role=role, size=13.5, bold=bold, gap=gap):
                        named.add(setting.method)
                        if gap != NEAR:
                            yield Line([(x, y), nearest(labels.placed[-1].box, x, y)], role)
        order = {"worthwhile": 0, "front": 1, "dominated": 2, "variant": 3}
        for setting, verdict in sorted(self.shown, key=lambda pair: order.get(pair[1].standing, 4)):
            text = short(setting.knob) if setting.knob is not None else ""
            if setting.precision != PLAIN:
                text = setting.precision
            if setting.precision == DOUBLES:
                text = f"{text}, {milliseconds(setting.seconds)}"
            if text and not setting.peer:
                labels.put(
                    self.across(self.error(setting)),
                    self.up(setting),
                    text,
                    role=self.hue(setting.method) if verdict.standing == "worthwhile" else "muted",
                    size=11,
                    gap=10 if verdict.standing == "worthwhile" else 8,
                )

    def _naming(self, setting: Setting) -> tuple[bool, bool, float]:
        """Peers first, which have one mark each; then what is worth taking; of a method's the most accurate, where
        lines lie furthest apart."""
        worth = any(setting.method == each.method for each in self.report.worthwhile)
        return not setting.peer, not worth, -self.across(self.error(setting))

    def _tooltip(self, setting: Setting, verdict: Verdict) -> str:
        knob = self.report.knobs.get(setting.method, "knob")
        name = setting.method if setting.knob is None else f"{setting.method}, {knob} {short(setting.knob)}"
        stated = "" if setting.stated is None else f"\nstated {scientific(setting.stated)} ({setting.kind})"
        precision = "" if setting.precision == PLAIN else f", {setting.precision}"
        spread = f" +- {setting.spread * 100:.0f} %" if setting.spread else ""
        seen = ""
        if setting.delta_e is not None and setting.flip is not None:
            seen = f"\nCIEDE2000 {scientific(setting.delta_e)}, FLIP {scientific(setting.flip)}"
        return (
            f"{name}{precision}: {milliseconds(setting.seconds)}{spread}\nworst error {scientific(setting.worst)}, "
            f"typical {scientific(setting.typical)}{stated}{seen}\n{verdict.standing}: {verdict.reason}"
        )

    # ------------------------------------------------------------------------------------------------- legend, caption

    def _caption(self) -> tuple[list[Shape], int]:
        y = self.bottom + 68
        shapes: list[Shape] = []
        at = LEFT - 46
        entries: list[tuple[Shape, str]] = [
            (Dot(0, -4, "ink", 4.4), "worst case"),
            (Dot(0, -4, "ink", 4.4, hollow=True), "typical (median RMS)"),
            (Dot(0, -4, "ink", 4.4, opacity=0.4), "another one is better: point at it"),
            (Line([(-9, -4), (9, -4)], "front", 9), "Pareto front"),
        ]
        if any(setting.precision != PLAIN for setting, _ in self.shown):
            entries.append((Dot(0, -4, "ink", 4.4, "square", opacity=0.4), "kept in fewer bits"))
        if any(each.peer for each in self.report.settings):
            entries.append((Dot(0, -4, "peer", 4.4, "diamond"), "another library"))
        if any(each.failed for each in self.report.settings):
            entries.append((Dot(0, -4, "failed", 4.4, "cross"), "could not run"))
        for mark, text in entries:
            told = Text(at + 20, y, text, "muted", 12)
            if told.box[2] > WIDTH - 20:
                at, y = LEFT - 46, y + 20
                told = replace(told, x=at + 20, y=y)
            shapes += [_moved(mark, at + 7, y), told]
            at = told.box[2] + 16
        y += 14
        for line in self._small_print():
            for part in wrapped(line, WIDTH - 48, 11):
                y += 16
                shapes.append(Text(LEFT - 46, y, part, "muted", 11))
        return shapes, round(y + 22)

    def _speed(self) -> str:
        """In points a second, as those count who make noise."""
        fastest = self.report.front[:1] if self.report.study else []
        return "".join(f"; {each.label}: {self.report.megapoints(each):.0f} Mpoint/s" for each in fastest)

    def _small_print(self) -> list[str]:
        facts = ", ".join(self.report.machine.values())
        named: dict[str, list[str]] = {}
        for method, knob in self.report.knobs.items():
            named.setdefault(knob, []).append(method)
        numbers = "; ".join(f"{knob} ({', '.join(methods)})" for knob, methods in named.items())
        return [
            *([f"Numbers at the marks: {numbers}."] if numbers else []),
            *([self.report.converging] if self.report.orders else []),
            f"{self.report.device}, {self.report.image}{self._speed()}. {facts}.",
            self.report.source,
            f"Again: {self.report.command}",
        ]


def _moved(mark: Shape, by: float, down: float) -> Shape:
    """A mark of the legend to its place."""
    if isinstance(mark, Dot):
        return replace(mark, x=mark.x + by, y=mark.y + down)
    if isinstance(mark, Line):
        return replace(mark, points=[(x + by, y + down) for x, y in mark.points])
    return mark
