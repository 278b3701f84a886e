"""Control of the axes in three layers, which import only downwards: groups, sources, loop."""
