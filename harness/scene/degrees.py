"""Trigonometry in degrees, exact where the result is a simple number: ``sind(30) == 0.5``."""

from __future__ import annotations

import math


def sind(angle: float) -> float:
    """Sine of an angle in degrees, exact at the multiples of 30° where it is rational."""
    angle = math.fmod(angle, 360.0)  # fmod is exact
    sign = math.copysign(1.0, angle)
    angle = abs(angle)
    if angle >= 180.0:
        sign, angle = -sign, angle - 180.0
    if angle > 90.0:
        angle = 180.0 - angle
    if angle == 0.0:
        return 0.0
    if angle == 30.0:
        return 0.5 * sign
    # The cosine of the complement is the more precise one above 45 degrees.
    if angle > 45.0:
        return sign * math.cos(math.radians(90.0 - angle))
    return sign * math.sin(math.radians(angle))


def cosd(angle: float) -> float:
    """Cosine of an angle in degrees, exact at the multiples of 60° and 90°."""
    angle = abs(math.fmod(angle, 360.0))
    if angle > 180.0:
        angle = 360.0 - angle
    if angle > 90.0:
        return -sind(angle - 90.0) if angle != 90.0 else 0.0
    return sind(90.0 - angle)


def tand(angle: float) -> float:
    """Tangent of an angle in degrees; raises ValueError where it is infinite."""
    cosine = cosd(angle)
    if cosine == 0.0:
        raise ValueError(f"the tangent of {angle:g}° is infinite")
    if abs(sind(angle)) == abs(cosine):
        return math.copysign(1.0, sind(angle)) * math.copysign(1.0, cosine)
    return sind(angle) / cosine


def asind(sine: float) -> float:
    """Angle in degrees from -90 to 90; raises ValueError outside [-1, 1]."""
    if abs(sine) == 0.5:
        return math.copysign(30.0, sine)
    return math.degrees(math.asin(sine))


def acosd(cosine: float) -> float:
    """Angle in degrees from 0 to 180; raises ValueError outside [-1, 1]."""
    if abs(cosine) == 0.5:
        return 60.0 if cosine > 0 else 120.0
    return math.degrees(math.acos(cosine))


def atand(tangent: float) -> float:
    """Angle in degrees from -90 to 90."""
    return math.degrees(math.atan(tangent))
