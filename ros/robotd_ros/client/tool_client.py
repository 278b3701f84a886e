"""Move the tool of a running robot, and ask for its kinematics, from another process."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from geometry_msgs.msg import Pose, PoseStamped, TransformStamped
from robotd_msgs.action import MoveTool
from robotd_msgs.msg import Scene, SceneObject
from robotd_msgs.srv import ChangeScene, ComputeFk, ComputeIk, SelectFrame
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from robotd_ros.client.motion_client import Ending, GoalRun
from robotd_ros.client.ros_client import RosClient
from robotd_ros.node_names import OPERATOR_NODE
from robotd_ros.qos import LATCHED

ACTION = f"{OPERATOR_NODE}/move_tool"
FRAMES = {
    "base": MoveTool.Goal.RELATIVE_BASE,
    "tool": MoveTool.Goal.RELATIVE_TOOL,
    "": MoveTool.Goal.BASE,
}

OnToolProgress = Callable[[float, Any], None]


def move_tool(
    client: RosClient,
    poses: Sequence[Pose],
    is_canceled: Callable[[], bool],
    on_progress: OnToolProgress,
    *,
    group: str = "",
    frame: str = "",
    line: bool = False,
    blend_m: float = 0.0,
    speed: float = 1.0,
    plan_only: bool = False,
) -> tuple[Ending, str]:
    """Move the tool; return at standstill, with the robot's reason.

    Args:
        is_canceled: asked all the time; once it is true, the robot is asked to stop.
        on_progress: called with 0 to 1, and the measured pose.
        frame: "" for poses in the work frame or the base; "base" or "tool" for displacements
            along the axes of that or of the tool.
        group, line, blend_m, speed, plan_only: fields of the goal.

    Raises DeviceTimeout: no answer or no feedback in time.
    """
    goal = MoveTool.Goal(
        group=group,
        frame=FRAMES[frame],
        poses=list(poses),
        line=line,
        blend_m=blend_m,
        speed=speed,
        plan_only=plan_only,
    )

    def show(feedback: Any) -> None:
        on_progress(feedback.progress, feedback.pose)

    run = GoalRun(client, MoveTool, show, lambda result: str(result.message))
    return run.run(ACTION, goal, is_canceled)


def tool_pose(client: RosClient, group: str = "") -> tuple[Pose, str, str]:
    """Return the pose of the tool, its frame and its name. Raises OperationError."""
    answer = client.call(ComputeFk, f"{OPERATOR_NODE}/compute_fk", group=group)
    stamped = answer.pose_stamped
    return stamped.pose, str(stamped.header.frame_id), str(answer.message)


def chosen_frames(client: RosClient) -> list[TransformStamped]:
    """Return the chosen tool in its link and the chosen work frame in the base, of each group.

    What is not chosen is not among them. Raises DeviceTimeout.
    """
    with client.listen(TFMessage, f"{OPERATOR_NODE}/tool_frames", LATCHED) as messages:
        return list(messages.wait().transforms)


def joint_solutions(
    client: RosClient, pose: Pose, *, group: str = "", everything: bool = False
) -> list[Mapping[str, float]]:
    """Return joint positions of a pose, nearest first. Raises OperationError: with the reason."""
    request = {"group": group, "all": everything, "seed": JointState()}
    stamped = PoseStamped(pose=pose)
    answer = client.call(ComputeIk, f"{OPERATOR_NODE}/compute_ik", pose_stamped=stamped, **request)
    return [
        dict(zip(solution.name, solution.position, strict=True)) for solution in answer.solutions
    ]


def select_tool(client: RosClient, name: str, group: str = "") -> str:
    """Choose a tool, "" for the link itself. Raises OperationError."""
    return _select(client, "set_tool", name, group)


def select_work_frame(client: RosClient, name: str, group: str = "") -> str:
    """Choose a work frame, "" for the base. Raises OperationError."""
    return _select(client, "set_work_frame", name, group)


def set_reduced_speed(client: RosClient, *, on: bool) -> str:
    """Limit the speed of the arms, or end that; return the state. Raises OperationError."""
    return client.switch(f"{OPERATOR_NODE}/set_reduced_speed", on)


def scene_objects(client: RosClient) -> list[Any]:
    """Return the objects of the scene. Raises DeviceTimeout."""
    with client.listen(Scene, f"{OPERATOR_NODE}/scene", LATCHED) as messages:
        return list(messages.wait().objects)


def change_scene(client: RosClient, operation: str, **fields: Any) -> str:
    """Change the scene; return what the robot says.

    Args:
        operation: "add", "remove", "move", "attach" or "detach".
        fields: of the object.

    Raises OperationError: with the reason.
    """
    number = getattr(ChangeScene.Request, operation.upper())
    item = SceneObject(**fields)
    answer = client.call(
        ChangeScene, f"{OPERATOR_NODE}/change_scene", operation=number, object=item
    )
    return str(answer.message)


def _select(client: RosClient, service: str, name: str, group: str) -> str:
    answer = client.call(SelectFrame, f"{OPERATOR_NODE}/{service}", name=name, group=group)
    return str(answer.message)
