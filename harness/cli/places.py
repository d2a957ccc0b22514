"""Where renderers run: in processes of this machine, or on a cluster."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from harness.cluster import Cluster
    from harness.renderers.base import Renderer


@dataclass(frozen=True)
class Place:
    """Here, or on `cluster`."""

    cluster: Cluster | None = None

    def renderers(
        self, names: Sequence[str], commands: Sequence[str], configs: Sequence[Path]
    ) -> tuple[list[Renderer], Renderer]:
        """The chosen renderers and the one that makes auxiliary pictures, chosen or not."""
        from harness.cli.options import chosen_renderers
        from harness.renderers import registry
        from harness.run import HELPER

        chosen = chosen_renderers(names, commands, configs)
        helper = next((r for r in chosen if r.name == HELPER), None) or registry.create(HELPER)
        if self.cluster is None:
            return chosen, helper
        from harness import remote

        origins = [remote.Origin("registered", one.name) for one in chosen]
        mine = [remote.origin_of_command(template) for template in commands]
        mine += [remote.origin_of_config(path) for path in configs]
        origins[len(origins) - len(mine) :] = mine
        there = [
            self.cluster.renderer(one.name, origin)
            for one, origin in zip(chosen, origins, strict=True)
        ]
        by_name = {one.name: one for one in there}
        origin = remote.Origin("registered", HELPER)
        return [*there], by_name.get(HELPER) or self.cluster.renderer(HELPER, origin)

    def threads(self, here: int) -> int:
        """Of one render: all of a machine's, or one where its cores have a worker each."""
        return here if self.cluster is None else 1


@contextlib.contextmanager
def places(cluster: str | None) -> Iterator[Place]:
    """Here, or on the cluster that `cluster` names. Raises InputError, ConnectionLost."""
    if cluster is None:
        yield Place()
        return
    from harness.cluster import connected

    with connected(cluster) as found:
        yield Place(found)
