"""Control of the axes in three storeys, which import only downwards: groups, sources, loop."""
