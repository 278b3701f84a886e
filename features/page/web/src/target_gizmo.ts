// Target of a tool in the 3D view: handles to drag, and the posture that reaches it as a ghost of the arm.

import * as THREE from "three";
import type { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { TransformControls } from "three/examples/jsm/controls/TransformControls.js";
import type { URDFRobot } from "urdf-loader";
import type { RobotModel } from "./robot_model";

const REACHABLE = new THREE.Color(0x1d8a4e);
const UNREACHABLE = new THREE.Color(0xd11a1a);

export class TargetGizmo {
  onDrag: (isFinal: boolean) => void = () => {}; // the target was dragged, or was let go
  private readonly controls: TransformControls;
  private readonly base = new THREE.Group(); // of the arm; it and the ghost are not moved by the tree
  private readonly handle = new THREE.Object3D();
  private readonly target = new THREE.Quaternion(); // rotation of the target in that of the handle
  private readonly material = new THREE.MeshStandardMaterial({
    transparent: true,
    opacity: 0.4,
    depthWrite: false,
    polygonOffset: true, // over the solids of the robot, where both are in one place
    polygonOffsetFactor: -1,
    polygonOffsetUnits: -1,
  });
  private readonly place = new THREE.Group(); // of the ghost
  private model: RobotModel | undefined;
  private ghost: URDFRobot | undefined;
  private link = "";

  constructor(
    camera: THREE.Camera,
    canvas: HTMLCanvasElement,
    private readonly scene: THREE.Scene,
    orbit: OrbitControls,
    private readonly redraw: () => void,
  ) {
    this.controls = new TransformControls(camera, canvas);
    this.controls.setSpace("local");
    this.base.matrixAutoUpdate = this.place.matrixAutoUpdate = false;
    this.base.add(this.handle);
    this.controls.addEventListener("change", redraw);
    this.controls.addEventListener("dragging-changed", ({ value }) => {
      orbit.enabled = !value;
      if (!value) this.onDrag(true);
    });
    this.controls.addEventListener("objectChange", () => this.onDrag(false));
  }

  // Use another model of the robot, whose solids the ghost shows.
  use(parent: THREE.Object3D, model: RobotModel): void {
    if (this.model === model) return;
    this.hide();
    this.model = model;
    parent.add(this.base, this.place);
  }

  // Show the handles, with the axes of the base or of the tool.
  show(link: string, pose: number[], frame: "base" | "tool"): void {
    this.hide();
    this.link = link;
    this.set(new THREE.Matrix4().fromArray(pose), frame);
    this.follow(this.model!);
    this.scene.add(this.controls.getHelper());
    this.controls.attach(this.handle);
    this.redraw();
  }

  hide(): void {
    this.controls.detach();
    this.scene.remove(this.controls.getHelper());
    this.place.clear();
    this.ghost = undefined;
    this.redraw();
  }

  setMode(mode: "translate" | "rotate"): void {
    this.controls.setMode(mode);
  }

  // Turn the handles to the axes of the base or of the tool.
  align(frame: "base" | "tool"): void {
    this.set(new THREE.Matrix4().fromArray(this.pose), frame);
    this.redraw();
  }

  // Target in the base of the arm, column by column.
  get pose(): number[] {
    const { position, quaternion } = this.handle;
    return new THREE.Matrix4().compose(position, quaternion.clone().multiply(this.target), new THREE.Vector3(1, 1, 1)).elements;
  }

  // Show the posture that reaches the target; null: none does, the last one stays.
  showPosture(joints: Record<string, number> | null): void {
    this.material.color.copy(joints ? REACHABLE : UNREACHABLE);
    if (joints) {
      this.ghost ??= this.makeGhost(Object.keys(joints));
      this.ghost.setJointValues(joints);
    }
    this.redraw();
  }

  // Go to where the base of the arm is.
  follow(model: RobotModel): void {
    const base = model.placeOf(this.link);
    if (base) this.base.matrix.copy(base);
    this.place.matrix.copy(model.object.matrix);
    this.base.matrixWorldNeedsUpdate = this.place.matrixWorldNeedsUpdate = true;
  }

  private set(pose: THREE.Matrix4, frame: "base" | "tool"): void {
    const rotation = new THREE.Quaternion().setFromRotationMatrix(pose);
    this.handle.position.setFromMatrixPosition(pose);
    this.handle.quaternion.copy(frame === "tool" ? rotation : new THREE.Quaternion());
    this.target.copy(frame === "tool" ? new THREE.Quaternion() : rotation);
  }

  // The links that these joints move, in one colour.
  private makeGhost(joints: string[]): URDFRobot {
    const ghost = this.model!.copy();
    const moved = new Set<THREE.Object3D>();
    for (const name of joints) ghost.joints[name]?.traverse((each) => moved.add(each));
    ghost.traverse((each) => {
      if (!(each instanceof THREE.Mesh)) return;
      each.material = this.material;
      each.visible = moved.has(each);
    });
    this.place.add(ghost);
    return ghost;
  }
}
