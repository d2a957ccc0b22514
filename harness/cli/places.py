"""Where renderers run: in processes of this machine, or on a cluster."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from harness.renderers.base import Renderer
    from harness.running.cluster import Cluster


@dataclass(frozen=True)
class Place:
    """Here, or on `cluster`."""

    cluster: Cluster | None = None

    def put(
        self, chosen: Sequence[Renderer], commands: Sequence[str], configs: Sequence[Path]
    ) -> tuple[list[Renderer], Renderer]:
        """The chosen renderers as they are here, and the one that makes auxiliary pictures.

        `commands` and `configs` are what the user's own among them were made from.
        """
        from harness.renderers import registry
        from harness.run import HELPER
        from harness.running import remote

        if self.cluster is None:
            helper = next((one for one in chosen if one.name == HELPER), None)
            return list(chosen), helper or registry.create(HELPER)
        origins = {registry.command_renderer(t).name: remote.origin_of_command(t) for t in commands}
        origins |= {
            registry.configured_renderer(p).name: remote.origin_of_config(p) for p in configs
        }
        there: dict[str, Renderer] = {}
        for name in (*(one.name for one in chosen), HELPER):
            if name not in there:
                origin = origins.get(name, remote.Origin("registered", name))
                there[name] = self.cluster.renderer(name, origin)
        return [there[one.name] for one in chosen], there[HELPER]

    def threads(self, here: int) -> int:
        """Of one render: all of a machine's, or one where its cores have a worker each."""
        return here if self.cluster is None else 1


@contextlib.contextmanager
def places(cluster: str | None) -> Iterator[Place]:
    """Here, or on the cluster that `cluster` names. Raises InputError, ConnectionLost."""
    if cluster is None:
        yield Place()
        return
    from harness.running.cluster import connected

    with connected(cluster) as found:
        yield Place(found)
