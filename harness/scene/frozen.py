"""What all parts of the resolved scene are made of."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

Vec3 = tuple[float, float, float]
Rgb = tuple[float, float, float]


class Frozen(BaseModel):
    """Immutable, and anything unknown in it is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
