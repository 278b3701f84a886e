// Path of a tool in the 3D view, before anything moves: to the start of a path, and along it.

import * as THREE from "three";
import { Line2 } from "three/examples/jsm/lines/Line2.js";
import { LineGeometry } from "three/examples/jsm/lines/LineGeometry.js";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import type { URDFRobot } from "urdf-loader";
import { cssColor } from "./dom";
import type { RobotModel } from "./robot_model";
import type { Preview } from "./teach_messages";

const WIDTH = 5; // pixels
const MARK = 0.012; // radius of the ends, m

export class DrawnPath {
  readonly object = new THREE.Group();

  constructor() {
    this.object.matrixAutoUpdate = false;
  }

  // Draw the path of a link; where the joints move none of them, that of the last joint.
  show(model: RobotModel, links: string[], { joints, rows, approach }: Preview): void {
    this.clear();
    const ghost = model.copy();
    const part = partOf(ghost, links, joints);
    if (!part) return;
    const places = rows.map((row) => {
      joints.forEach((name, index) => ghost.setJointValue(name, row[index]!));
      part.updateWorldMatrix(true, false);
      return new THREE.Vector3().setFromMatrixPosition(part.matrixWorld);
    });
    this.line(places.slice(0, approach + 1), "--preview-approach");
    this.line(places.slice(approach), "--preview");
    this.mark(places[approach]!, "--preview-approach");
    this.mark(places.at(-1)!, "--preview");
    this.follow(model);
  }

  clear(): void {
    this.object.traverse((each) => {
      if (!(each instanceof THREE.Mesh)) return;
      each.geometry.dispose();
      each.material.dispose();
    });
    this.object.clear();
  }

  // Go to where the robot is.
  follow(model: RobotModel): void {
    this.object.matrix.copy(model.object.matrix);
    this.object.matrixWorldNeedsUpdate = true;
  }

  private line(places: THREE.Vector3[], color: string): void {
    if (places.length < 2) return;
    const geometry = new LineGeometry().setPositions(places.flatMap(({ x, y, z }) => [x, y, z]));
    this.object.add(onTop(new Line2(geometry, new LineMaterial({ color: cssColor(color), linewidth: WIDTH }))));
  }

  private mark(place: THREE.Vector3, color: string): void {
    const material = new THREE.MeshBasicMaterial({ color: cssColor(color) });
    const ball = new THREE.Mesh(new THREE.SphereGeometry(MARK, 16, 12), material);
    ball.position.copy(place);
    this.object.add(onTop(ball));
  }
}

// Drawn over the robot, which would hide most of it.
function onTop<T extends THREE.Mesh>(mesh: T): T {
  (mesh.material as THREE.Material).depthTest = false;
  mesh.renderOrder = 1;
  return mesh;
}

function partOf(ghost: URDFRobot, links: string[], joints: string[]): THREE.Object3D | undefined {
  const moving = joints.map((name) => ghost.joints[name]).filter((joint) => joint !== undefined);
  const isMoved = (link: THREE.Object3D | undefined): boolean => {
    for (let each = link?.parent; each; each = each.parent) if (moving.some((joint) => joint === each)) return true;
    return false;
  };
  return links.map((name) => ghost.links[name]).find(isMoved) ?? moving.at(-1);
}
