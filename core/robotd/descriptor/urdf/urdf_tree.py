"""Tree of links: one root, one parent for each link, no loop."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from robotd.descriptor.urdf.urdf_model import UrdfJoint, UrdfLink


def check_tree(
    links: Mapping[str, UrdfLink], joints: Iterable[UrdfJoint]
) -> Iterator[tuple[str, int, str]]:
    """Yield each problem as text, line and name of the joint or link."""
    parents: dict[str, UrdfJoint] = {}
    for joint in joints:
        if joint.child in parents:
            other = parents[joint.child].name
            what = (
                f"child link {joint.child!r} is held by joint {other!r} already: the two close a"
                " loop, a URDF is a tree; remove one of them"
            )
            yield what, joint.line, joint.name
        else:
            parents[joint.child] = joint
    yield from _loops(parents)
    roots = [link for link in links.values() if link.name not in parents]
    for root in roots[1:]:
        what = f"link is a second root, besides {roots[0].name!r}: no joint connects it"
        yield what, root.line, root.name


def depth_first(
    links: Mapping[str, UrdfLink], joints: Iterable[UrdfJoint]
) -> tuple[str, list[UrdfJoint]]:
    """Return the root of a valid tree and its joints, depth first."""
    children: dict[str, list[UrdfJoint]] = {}
    for joint in joints:
        children.setdefault(joint.parent, []).append(joint)
    held = {joint.child for group in children.values() for joint in group}
    root = next(name for name in links if name not in held)
    ordered: list[UrdfJoint] = []
    waiting = children.get(root, [])[::-1]
    while waiting:
        joint = waiting.pop()
        ordered.append(joint)
        waiting += children.get(joint.child, [])[::-1]
    return root, ordered


def _loops(parents: Mapping[str, UrdfJoint]) -> Iterator[tuple[str, int, str]]:
    """Yield each loop once, at its first joint."""
    done: set[str] = set()
    for start in parents:
        visited: list[str] = []
        link = start
        while link in parents and link not in done and link not in visited:
            visited.append(link)
            link = parents[link].parent
        if link in visited:
            loop = visited[visited.index(link) :][::-1]
            joint = min((parents[link] for link in loop), key=lambda joint: joint.line)
            yield f"links form a loop: {' → '.join([*loop, loop[0]])}", joint.line, joint.name
        done.update(visited)
