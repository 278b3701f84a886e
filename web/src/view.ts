// 3D view of the robot: drawn when something has changed.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { onThemeChange } from "./colors";
import { cssColor, find, setText } from "./dom";
import type { Description, Sample } from "./messages";
import { RobotModel } from "./robot_model";

const MARGIN = 1.15; // around the robot with its arm stretched

export class View {
  private readonly canvas = find<HTMLCanvasElement>("canvas");
  private readonly note = find("view-note");
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(32, 1, 0.01, 100);
  private renderer: THREE.WebGLRenderer | undefined;
  private controls: OrbitControls | undefined;
  private model: RobotModel | undefined;
  private ground: THREE.Object3D | undefined;
  private dirty = true;
  private reach = 1;

  constructor() {
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
    } catch {
      setText(this.note, "This browser has no WebGL: the robot is not drawn.");
      this.canvas.hidden = true;
      return;
    }
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.scene.rotation.x = -Math.PI / 2; // z upwards, as in a URDF
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 2);
    sun.position.set(1.5, -2, 3);
    this.scene.add(sun);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => this.cameraMoved());
    this.canvas.addEventListener("keydown", (event) => this.onKey(event));
    find("view-reset").addEventListener("click", () => this.resetCamera());
    new ResizeObserver(() => this.resize()).observe(this.canvas.parentElement!);
    onThemeChange(() => this.drawGround());
  }

  describe(description: Description): void {
    if (!this.renderer) return;
    if (this.model) this.scene.remove(this.model.object);
    this.model = undefined;
    if (!description.urdf) {
      setText(this.note, "This robot has no URDF: there is nothing to draw.");
      return;
    }
    this.model = new RobotModel(description, () => {
      this.fit();
      this.dirty = true;
    });
    this.scene.add(this.model.object);
    this.fit();
    this.resetCamera();
  }

  show(sample: Sample): void {
    this.model?.show(sample);
    this.dirty = true;
  }

  setFaults(faulty: boolean[]): void {
    faulty.forEach((on, axis) => {
      if (this.model?.setFault(axis, on)) this.dirty = true;
    });
  }

  draw(): void {
    if (!this.dirty || !this.renderer) return;
    this.dirty = false;
    this.renderer.render(this.scene, this.camera);
  }

  // Size of the robot: the sphere around its base that it can reach, as it is now.
  private fit(): void {
    if (!this.model) return;
    this.scene.updateMatrixWorld(true);
    const box = new THREE.Box3().setFromObject(this.model.object);
    const size = box.getSize(new THREE.Vector3()).length();
    if (Number.isFinite(size) && size > 0) this.reach = size;
    this.drawGround();
  }

  private drawGround(): void {
    if (this.ground) this.scene.remove(this.ground);
    const step = 10 ** Math.round(Math.log10(this.reach / 6));
    const color = new THREE.Color(cssColor("--grid"));
    const grid = new THREE.GridHelper(step * 40, 40, color, color);
    grid.rotation.x = Math.PI / 2;
    this.ground = grid;
    this.scene.add(grid);
    this.dirty = true;
  }

  private resetCamera(): void {
    const distance = (this.reach * MARGIN) / (2 * Math.tan((this.camera.fov * Math.PI) / 360));
    const height = this.reach * 0.36;
    this.controls!.target.set(0, height, 0);
    this.camera.position.set(0.62 * distance, height + 0.3 * distance, 0.73 * distance);
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
