"""The drawing of a section, element by element.

Media are tinted the more the higher their index, and a ray fades with what it carries. Lines and
letters have the colour of the text around the image (`currentColor`), so that one drawing serves
light and dark pages; a drawing that is to stand alone brings its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from harness.record import RayPath
from harness.scene.resolved import Plane, ResolvedScene, Solid, SurfaceShape
from harness.section.outline import Cut, Points, Window, along_face, outline

Box = tuple[float, float, float, float]  # left, top, right, bottom

WIDTH = 720.0  # of the drawing, in its own units
NORMAL, ARC = 44.0, 26.0  # lengths of normals and radii of angles
LETTER, LINE = 6.6, 15.0  # width and height that a letter of a label takes
FEW = 48  # corners of an outline, at most, that labels keep away from
FAINTEST = 0.25  # opacity of a ray that carries nothing
RAY = "#d9480f"  # the colour of rays that have none of their own
TINTS = (1.0, 2.5)  # indices between which a medium's tint deepens
INK = (
    "svg{color:#1b1f24;background:#fff}"
    "@media(prefers-color-scheme:dark){svg{color:#e6e9ed;background:#14171b}}"
)


class Canvas:
    """Collects SVG elements; y runs downwards on it. Texts come last, where there is room."""

    def __init__(self, cut: Cut, window: Window) -> None:
        self.cut, self.window = cut, window
        self.scale = WIDTH / window.width
        self.height = self.scale * window.height
        self.elements: list[str] = []
        self.texts: list[tuple[str, list[Points]]] = []  # and where they may stand, best first
        self.names: list[tuple[str, list[Points]]] = []  # of media, which have most room
        self.lines: list[tuple[Points, Points]] = []  # what no text should cover

    def _flat(self, points: Points) -> Points:
        """Points of the plane (n, 2) on the canvas."""
        x = (points[:, 0] - self.window.x0) * self.scale
        y = (self.window.y1 - points[:, 1]) * self.scale
        return np.stack([x, y], axis=1)

    def solid(self, scene: ResolvedScene, solid: Solid) -> None:
        """A solid's cut faces, tinted, with its medium's name."""
        loops = [self._flat(loop) for loop in outline(solid.shape, self.cut, self.window)]
        if not loops:
            return
        for loop in loops:
            edge = loop[:: -(-len(loop) // FEW)]  # near enough to keep a text off it
            self.lines += list(zip(edge, np.roll(edge, -1, axis=0), strict=True))
        medium = scene.media[solid.medium]
        d = " ".join("M" + " L".join(map(_pair, loop)) + "Z" for loop in loops)
        low, high = TINTS
        depth = min(max((medium.ior - low) / (high - low), 0.0), 1.0)
        self.elements.append(
            f'<path class="solid" d="{d}" fill="#3b8ad9" fill-opacity="{0.1 + 0.38 * depth:.3f}" '
            'fill-rule="evenodd" stroke="currentColor" stroke-opacity=".65" stroke-width="1.2" '
            f'stroke-linejoin="round"><title>{escape(solid.name)}</title></path>'
        )
        text = f"{medium.name} n = {medium.ior:.6g}"
        if spots := self._spots_within(loops, LETTER * len(text) / 2):
            self.names.append((text, spots))

    def _spots_within(self, loops: list[Points], half: float) -> list[Points]:
        """Where a text of half that width lies wholly in a solid, from the bottom upwards."""
        edge = np.clip(np.concatenate(loops), 12, [WIDTH - 12, self.height - 12])
        (left, top), (right, bottom) = edge.min(axis=0), edge.max(axis=0)
        rows, columns = np.linspace(bottom - LINE, top + LINE, 12), np.linspace(left, right, 15)
        middle = (left + right) / 2
        columns = columns[np.argsort(np.abs(columns - middle), kind="stable")]
        spots = np.array([(x, y) for y in rows for x in columns])
        box = np.array([(dx, dy) for dx in (-half, 0, half) for dy in (-LINE / 2, LINE / 2)])
        fits = np.all([_within(spots + corner, loops) for corner in box], axis=0)
        return list(spots[fits])

    def face(self, shape: SurfaceShape, glows: bool) -> None:
        """An open face, seen on edge."""
        ends = along_face(shape, self.cut)
        if ends is not None:
            a, b = self._flat(ends)
            if isinstance(shape, Plane):
                a, b = _clipped(a, b, (0.0, 0.0, WIDTH, self.height)) or (a, a)
            self._line("face", a, b, "#e0a100" if glows else "#8a94a0", 3.5)

    def ray(self, path: RayPath, colour: str = RAY) -> None:
        """All legs, each as opaque as it is bright, and an arrow in the middle of what is seen."""
        points = self._flat(self.cut.project(np.array(path.vertices)))
        for a, b, weight in zip(points[:-1], points[1:], path.weights, strict=True):
            seen = _clipped(a, b, (0.0, 0.0, WIDTH, self.height))
            if seen is None:
                continue
            start, end = seen
            opacity = FAINTEST + (1 - FAINTEST) * math.sqrt(min(max(weight, 0.0), 1.0))
            self._line("ray", start, end, colour, 1.8, opacity)
            if np.linalg.norm(end - start) > 24:
                u = _unit(end - start)
                v = np.array([-u[1], u[0]])
                tip = (start + end) / 2 + 5 * u
                wings = " ".join(map(_pair, (tip, tip - 10 * u + 3.6 * v, tip - 10 * u - 3.6 * v)))
                self.elements.append(
                    f'<polygon points="{wings}" fill="{colour}" fill-opacity="{opacity:.3f}"/>'
                )

    def angles(self, path: RayPath, k: int) -> None:
        """The normal at an interface, and on either side of it the angle of the ray."""
        a, p, b = self._flat(self.cut.project(np.array(path.vertices[k : k + 3])))
        back, onward = _unit(a - p), _unit(b - p)
        theta_i, theta_t = path.angles[k]
        n = _drawn_normal(back, onward, theta_i, theta_t)
        self._line("normal", p + NORMAL * n, p - NORMAL * n, "currentColor", 1, 0.5, "4 3")
        reflected = float(onward @ n) > 0
        self._angle("θi", theta_i, p, back, n)
        self._angle("θr" if reflected else "θt", theta_t, p, onward, n if reflected else -n)

    def _angle(self, name: str, theta: float, p: Points, ray: Points, side: Points) -> None:
        """An arc about `p` between a ray and its side of the normal, and the angle in degrees."""
        sweep = int(ray[0] * side[1] - ray[1] * side[0] > 0)
        self.elements.append(
            f'<path class="angle" d="M{_pair(p + ARC * ray)} A{ARC:g} {ARC:g} 0 0 {sweep} '
            f'{_pair(p + ARC * side)}" fill="none" stroke="currentColor" stroke-opacity=".8"/>'
        )
        middle = _unit(ray + side)
        turns = (0, 25, -25, 50, -50, 75, -75, 100, -100)
        spots = [p + r * _turned(middle, turn) for r in (48, 60, 80, 104) for turn in turns]
        self.texts.append((f"{name} {theta:.2f}°", spots))

    def ruler(self) -> None:
        """How long a round number of units is."""
        most = self.window.width / 4
        decade = 10.0 ** math.floor(math.log10(most))
        length = max(f * decade for f in (1, 2, 2.5, 5) if f * decade <= most)
        x, y = 14.0, self.height - 12
        end = x + length * self.scale
        self.elements.append(
            f'<path d="M{x:.2f} {y - 4:.2f}v8M{x:.2f} {y:.2f}H{end:.2f}m0 -4v8" fill="none" '
            'stroke="currentColor" stroke-opacity=".7"/>'
        )
        text = f"{length:g} unit" + ("" if length == 1 else "s")
        spot = np.array([end + 8 + LETTER * len(text) / 2, y])
        self.texts.insert(0, (text, [spot]))

    def text(self, title: str, standalone: bool) -> str:
        """The whole image."""
        head = (
            '<svg xmlns="http://www.w3.org/2000/svg" class="section" role="img" '
            f'viewBox="0 0 {WIDTH:g} {self.height:.2f}" font-family="system-ui, sans-serif" '
            'font-size="12" text-anchor="middle" fill="currentColor">'
        )
        named = f"<title>{escape(title)}</title>" if title else ""
        style = f"<style>{INK}</style>" if standalone else ""
        return "\n".join((head + named + style, *self.elements, *self._labels(), "</svg>")) + "\n"

    def _labels(self) -> list[str]:
        """Each text where it covers least of other texts and of lines."""
        taken: list[Box] = []
        texts = self.texts + self.names
        for text, spots in texts:
            half, high = LETTER * len(text) / 2, LINE / 2
            room = np.array([WIDTH - half - 3, self.height - high - 2])
            inside = [np.clip(spot, [half + 3, high + 2], room) for spot in spots]
            boxes = [(x - half, y - high, x + half, y + high) for x, y in inside]
            taken.append(min(boxes, key=lambda box: self._covered(box, taken)))
        return [
            f'<text x="{(left + right) / 2:.2f}" y="{bottom - 3.5:.2f}">{escape(text)}</text>'
            for (text, _), (left, _, right, bottom) in zip(texts, taken, strict=True)
        ]

    def _covered(self, box: Box, taken: Sequence[Box]) -> float:
        """What a label in `box` hides, in square units; a line counts as ten units wide."""
        texts = sum(_overlap(box, other) for other in taken)
        parts = (_clipped(a, b, box) for a, b in self.lines)
        return 10 * texts + sum(10 * float(np.linalg.norm(p[1] - p[0])) for p in parts if p)

    def _line(
        self,
        name: str,
        a: Points,
        b: Points,
        colour: str,
        width: float,
        opacity: float = 1.0,
        dashes: str = "",
    ) -> None:
        self.lines.append((a, b))
        dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
        self.elements.append(
            f'<line class="{name}" x1="{a[0]:.2f}" y1="{a[1]:.2f}" x2="{b[0]:.2f}" y2="{b[1]:.2f}" '
            f'stroke="{colour}" stroke-width="{width:g}" stroke-opacity="{opacity:.3f}"{dashed}/>'
        )


def _drawn_normal(back: Points, onward: Points, theta_i: float, theta_t: float) -> Points:
    """The normal on the incident side for which both drawn angles are the true ones."""
    turned = [_turned(back, sign * theta_i) for sign in (1, -1)]

    def misfit(n: Points) -> float:
        across = abs(float(n[0] * onward[1] - n[1] * onward[0]))
        return abs(math.degrees(math.atan2(across, abs(float(n @ onward)))) - theta_t)

    return min(turned, key=misfit)


def _pair(point: Points) -> str:
    return f"{point[0]:.2f} {point[1]:.2f}"


def _unit(v: Points) -> Points:
    return np.asarray(v / max(float(np.linalg.norm(v)), 1e-300))


def _turned(v: Points, degrees: float) -> Points:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1]])


def _overlap(a: Box, b: Box) -> float:
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return max(width, 0.0) * max(height, 0.0)


def _within(points: Points, loops: list[Points]) -> NDArray[np.bool_]:
    """Which points (n, 2) lie inside: an odd number of edges is to the right of them."""
    odd = np.zeros(len(points), bool)
    for loop in loops:
        a, b = loop, np.roll(loop, -1, axis=0)
        y = points[:, 1, None]
        crosses = (a[:, 1] > y) != (b[:, 1] > y)
        slope = (b[:, 0] - a[:, 0]) / np.where(a[:, 1] == b[:, 1], 1.0, b[:, 1] - a[:, 1])
        right = points[:, 0, None] < a[:, 0] + (y - a[:, 1]) * slope
        odd ^= (crosses & right).sum(axis=1) % 2 == 1
    return odd


def _clipped(a: Points, b: Points, box: Box) -> tuple[Points, Points] | None:
    """The part of a segment inside a box (Y. Liang, B. Barsky, ACM Trans. Graphics 3, 1984)."""
    start, end = 0.0, 1.0
    for k in range(2):
        step = float(b[k] - a[k])
        if step == 0:
            if not box[k] <= a[k] <= box[2 + k]:
                return None
            continue
        first, last = sorted(float(edge - a[k]) / step for edge in (box[k], box[2 + k]))
        start, end = max(start, first), min(end, last)
    if start >= end:
        return None
    return a + start * (b - a), a + end * (b - a)
