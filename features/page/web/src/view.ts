// 3D view of the robot: drawn when something has changed.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { onThemeChange } from "./colors";
import { cssColor, find, setText } from "./dom";
import type { Description, GuardedSolid, Sample } from "./messages";
import { DrawnPath } from "./drawn_path";
import { RobotModel } from "./robot_model";
import { GuardedScene } from "./guarded_scene";
import { SceneObjects } from "./scene_objects";
import { TargetGizmo } from "./target_gizmo";
import type { Preview } from "./teach_messages";

const X_AXIS = new THREE.Vector3(1, 0, 0);
const NAMED_MESHES = 3;
const MARGIN = 1.15; // around the robot
const MAX_SCENE = 2; // diagonal of robot and objects, in that of the robot, up to which all are in the picture

export class View {
  private readonly canvas = find<HTMLCanvasElement>("canvas");
  private readonly note = find("view-note");
  private readonly meshNote = find("mesh-note");
  private missing: string[] = []; // names of meshes
  private readonly scene = new THREE.Scene();
  private readonly upright = new THREE.Group(); // of the scene, z upwards, as in a URDF
  private readonly camera = new THREE.PerspectiveCamera(32, 1, 0.01, 100);
  private renderer: THREE.WebGLRenderer | undefined;
  private controls: OrbitControls | undefined;
  private model: RobotModel | undefined;
  private objects: SceneObjects | undefined;
  private readonly solids = new GuardedScene();
  private readonly preview = new DrawnPath();
  private tools: string[] = []; // links
  private gizmo: TargetGizmo | undefined;
  private ground: THREE.Object3D | undefined;
  private shown: Sample | undefined; // the newest that differs
  private dirty = true;
  private reach = 1; // diagonal of what is in the picture
  private readonly middle = new THREE.Vector3(0, 0.5, 0); // of it, y upwards
  private step = 1; // of the grid
  private readonly followed = new THREE.Vector3(); // position of the base

  constructor() {
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
    } catch {
      setText(this.note, "This browser has no WebGL: the robot is not drawn.");
      this.canvas.hidden = true;
      return;
    }
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.upright.rotation.x = -Math.PI / 2;
    this.scene.add(this.upright);
    this.upright.add(this.solids.object, this.preview.object);
    this.upright.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 2);
    sun.position.set(1.5, -2, 3);
    this.upright.add(sun);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => this.cameraMoved());
    this.canvas.addEventListener("keydown", (event) => this.onKey(event));
    find("view-reset").addEventListener("click", () => this.resetCamera());
    new ResizeObserver(() => this.resize()).observe(this.canvas.parentElement!);
    onThemeChange(() => this.drawGround());
  }

  describe(description: Description): void {
    if (!this.renderer) return;
    if (this.model) this.upright.remove(this.model.object);
    if (this.objects) this.upright.remove(this.objects.object);
    this.gizmo?.hide();
    this.showPreview(undefined);
    this.tools = description.tools.map(({ link }) => link);
    this.model = this.shown = this.objects = undefined;
    this.missing = [];
    this.noteMissing([]);
    this.showSolids(description.urdf ? (description.solids ?? []) : []);
    if (!description.urdf) {
      setText(this.note, "This robot has no URDF: there is nothing to draw.");
      return;
    }
    const model = new RobotModel(description, () => this.complete(model));
    this.model = model;
    this.upright.add(model.object);
    if (description.objects) {
      this.objects = new SceneObjects(description.objects);
      this.upright.add(this.objects.object);
    }
    this.complete(model);
    this.canvas.dataset["meshes"] = Object.keys(description.meshes).length ? "loading" : "none";
  }

  // All solids are there, also those of files.
  private complete(model: RobotModel): void {
    this.noteMissing(model.drawMissing());
    model.ownMaterials();
    this.fit();
    this.resetCamera();
    this.canvas.dataset["meshes"] = "loaded";
  }

  private noteMissing(names: string[]): void {
    this.missing.push(...names);
    this.meshNote.hidden = !this.missing.length;
    const first = this.missing.slice(0, NAMED_MESHES).map((name) => name.split("/").at(-1));
    const rest = this.missing.length > NAMED_MESHES ? ", …" : "";
    const are = this.missing.length === 1 ? "1 mesh is" : `${this.missing.length} meshes are`;
    setText(this.meshNote, `${are} missing or not STL, DAE or glTF, capsules are shown instead: ${first.join(", ")}${rest}`);
  }

  show(sample: Sample): void {
    if (!this.model || this.shown?.looksLike(sample)) return;
    this.shown = sample;
    this.model.show(sample);
    this.objects?.follow(this.model);
    this.solids.follow(this.model);
    this.gizmo?.follow(this.model);
    this.preview.follow(this.model);
    this.follow(this.model.object.position);
    this.dirty = true;
  }

  moveObjects(poses: number[][]): void {
    this.objects?.move(poses);
    this.dirty = true;
  }

  showSolids(solids: GuardedSolid[]): void {
    this.solids.show(solids);
    if (this.model) this.solids.follow(this.model);
    this.canvas.dataset["solids"] = solids.map(({ name }) => name).join(" ");
    this.dirty = true;
  }

  // Draw the path of the tool in a motion that is not played yet; undefined: none.
  showPreview(preview: Preview | undefined): void {
    this.preview.clear();
    if (preview && this.model) this.preview.show(this.model, this.tools, preview);
    this.canvas.dataset["preview"] = preview ? `${preview.approach} ${preview.rows.length - preview.approach}` : "";
    this.dirty = true;
  }

  // What shows the target of a tool; undefined where the robot is not drawn.
  target(): TargetGizmo | undefined {
    if (!this.model || !this.controls) return undefined;
    this.gizmo ??= new TargetGizmo(this.camera, this.canvas, this.scene, this.controls, () => (this.dirty = true));
    this.gizmo.use(this.upright, this.model);
    return this.gizmo;
  }

  // Keep a base that drives in the picture.
  private follow(position: THREE.Vector3): void {
    const moved = position.clone().sub(this.followed).applyAxisAngle(X_AXIS, -Math.PI / 2);
    if (moved.lengthSq() === 0) return;
    this.followed.copy(position);
    this.controls!.target.add(moved);
    this.camera.position.add(moved);
    this.placeGround();
    this.cameraMoved();
  }

  private placeGround(): void {
    const { x, y } = this.followed;
    this.ground?.position.set(Math.round(x / this.step) * this.step, Math.round(y / this.step) * this.step, 0);
  }

  setFaults(faulty: boolean[]): void {
    faulty.forEach((on, axis) => {
      if (this.model?.setFault(axis, on)) this.dirty = true;
    });
  }

  // Frame of a link in the root of the URDF; undefined where the robot is not drawn.
  frameOf(link: string): THREE.Matrix4 | undefined {
    return this.model?.frameOf(link);
  }

  draw(): void {
    if (!this.dirty || !this.renderer) return;
    this.dirty = false;
    this.renderer.render(this.scene, this.camera);
  }

  // Size and middle of the robot as it is now, with the objects around it.
  private fit(): void {
    if (!this.model) return;
    this.objects?.follow(this.model);
    this.solids.follow(this.model);
    this.scene.updateMatrixWorld(true);
    const box = new THREE.Box3().setFromObject(this.model.object);
    const size = diagonalOf(box);
    if (Number.isFinite(size) && size > 0) {
      this.reach = size;
      this.middle.set(0, box.getCenter(new THREE.Vector3()).y, 0);
      if (this.objects) box.expandByObject(this.objects.object);
      if (this.objects && diagonalOf(box) < MAX_SCENE * size) {
        this.reach = diagonalOf(box);
        box.getCenter(this.middle);
      }
    }
    this.drawGround();
  }

  private drawGround(): void {
    if (this.ground) this.upright.remove(this.ground);
    const step = 10 ** Math.round(Math.log10(this.reach / 6));
    this.step = step;
    const color = new THREE.Color(cssColor("--grid"));
    const grid = new THREE.GridHelper(step * 40, 40, color, color);
    grid.rotation.x = Math.PI / 2;
    this.ground = grid;
    this.upright.add(grid);
    this.placeGround();
    this.dirty = true;
  }

  private resetCamera(): void {
    const distance = (this.reach * MARGIN) / (2 * Math.sin((this.camera.fov * Math.PI) / 360));
    const middle = this.followed.clone().applyAxisAngle(X_AXIS, -Math.PI / 2).add(this.middle);
    this.controls!.target.copy(middle);
    this.camera.position.set(0.62 * distance, 0.3 * distance, 0.73 * distance).add(middle);
    this.controls!.update();
    this.cameraMoved();
  }

  private cameraMoved(): void {
    this.camera.updateMatrixWorld();
    const matrix = new THREE.Matrix4()
      .multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse)
      .multiply(new THREE.Matrix4().makeRotationX(-Math.PI / 2));
    // From robot coordinates to the picture, row by row; tests check the drawing by it.
    this.canvas.dataset["projection"] = matrix.transpose().elements.map((each) => each.toPrecision(9)).join(" ");
    this.dirty = true;
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (!width || !height) return;
    this.renderer!.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.cameraMoved();
  }

  private onKey(event: KeyboardEvent): void {
    const turns: Record<string, [number, number, number]> = {
      ArrowLeft: [0.1, 0, 1],
      ArrowRight: [-0.1, 0, 1],
      ArrowUp: [0, -0.1, 1],
      ArrowDown: [0, 0.1, 1],
      "+": [0, 0, 0.9],
      "-": [0, 0, 1 / 0.9],
    };
    const turn = turns[event.key];
    if (!turn) return;
    event.preventDefault();
    const { target } = this.controls!;
    const offset = this.camera.position.clone().sub(target);
    const sphere = new THREE.Spherical().setFromVector3(offset);
    sphere.theta += turn[0];
    sphere.phi += turn[1];
    sphere.radius *= turn[2];
    sphere.makeSafe();
    this.camera.position.copy(target).add(new THREE.Vector3().setFromSpherical(sphere));
    this.controls!.update();
    this.cameraMoved();
  }
}

function diagonalOf(box: THREE.Box3): number {
  return box.getSize(new THREE.Vector3()).length();
}
