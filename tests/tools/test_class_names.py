"""Names of classes are unique where one reader could take one class for another."""

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


def test_features_have_different_names() -> None:
    (found,) = doubled({"features/page/jog.py": CLASS, "features/teach/keys.py": CLASS})
    assert found.startswith("class Jog is in features/page/jog.py and features/teach/keys.py:")
    assert [*doubled({"features/page/jog.py": CLASS, "plugins/sim/axes.py": CLASS})] == []


def test_a_plugin_repeats_no_name_but_in_its_simulation() -> None:
    backend, other = "plugins/ethercat/robotd_ethercat/jog.py", "plugins/ethercat/other.py"
    simulated = "plugins/ethercat/robotd_ethercat/simulated/jog.py"
    assert len([*doubled({backend: CLASS, other: CLASS})]) == 1
    assert [*doubled({backend: CLASS, simulated: CLASS})] == []


def test_private_and_inner_classes_do_not_count() -> None:
    inner = "class _Jog:\n    class Jog:\n        pass\n"
    assert [*doubled({"core/robotd/device/axes.py": CLASS, "core/robotd/other.py": inner})] == []
