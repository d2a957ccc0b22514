"""Colours that mean something: one per renderer on every page, and the difference maps' scale."""

from __future__ import annotations

from collections.abc import Iterable

# The stylesheet defines --c0 … --c7 for light and dark. The built-in renderers keep theirs in every
# report, so that a reader who has seen one knows the next.
PLACES = 8
BUILT_IN = {"tracer": 0, "povray": 1, "mitsuba": 2, "mitsuba-exact": 3}


def colour_classes(renderers: Iterable[str]) -> dict[str, str]:
    """The stylesheet class of each renderer: "truth" and "baseline" are classes of their own."""
    classes = {"truth": "truth", "baseline": "baseline"}
    others = 0
    for name in sorted(set(renderers) - set(classes)):
        if name in BUILT_IN:
            classes[name] = f"c{BUILT_IN[name]}"
        else:
            classes[name] = f"c{len(BUILT_IN) + others % (PLACES - len(BUILT_IN))}"
            others += 1
    return classes


# Inferno by Nathaniel Smith and Stéfan van der Walt (CC0), every eighth of its 256 entries: from
# black through red to pale yellow, monotonic in lightness. Linear interpolation between these
# stays within 2/255 of the original, and is just what an SVG gradient does, so that the colour
# bar shows the very colours of the map.
SCALE_TABLE = """
    000004 040312 0b0724 150b37 210c4a 2f0a5b 3d0965 4a0c6b 57106e 64156e 71196e
    7d1e6d 8a226a 972766 a32c61 b0315b bc3754 c63d4d d04545 da4e3c e35933 eb6429
    f1711f f67e14 f98c0a fb9b06 fcaa0f fbba1f f9c932 f5d949 f2e865 f3f586 fcffa4
"""
SCALE_HEX = SCALE_TABLE.split()
SCALE = tuple((int(h[:2], 16), int(h[2:4], 16), int(h[4:], 16)) for h in SCALE_HEX)

NOT_FINITE = (255, 0, 255)  # magenta: NaN and infinities, in pictures and in maps
BEYOND = (125, 249, 255)  # pale cyan: a difference beyond the map's limit
