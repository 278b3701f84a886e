"""Each class of the core has a name of its own; backends may repeat each other's."""

from __future__ import annotations

from tools.class_names import doubled

CLASS = "import x\n\n\nclass Jog(Base):\n    pass\n"


def test_a_class_of_the_core_has_its_name_alone() -> None:
    (found,) = doubled({"core/robotd/device/axes.py": CLASS, "features/page/jog.py": CLASS})
    assert found.startswith("class Jog is in core/robotd/device/axes.py and features/page/jog.py:")


def test_backends_may_repeat_each_other() -> None:
    assert [
        *doubled({"plugins/canopen/master.py": CLASS, "plugins/ethercat/master.py": CLASS})
    ] == []


def test_private_and_inner_classes_do_not_count() -> None:
    inner = "class _Jog:\n    class Jog:\n        pass\n"
    assert [*doubled({"core/robotd/device/axes.py": CLASS, "core/robotd/other.py": inner})] == []
