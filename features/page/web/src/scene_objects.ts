// Objects of a simulated world, as solids.

import * as THREE from "three";
import type { WorldObjects } from "./messages";
import type { RobotModel } from "./robot_model";

const MESH_EDGE = 0.05; // of the box that is drawn for a mesh, m

export class SceneObjects {
  readonly object = new THREE.Group(); // frame of the poses
  private readonly frame: string;
  private readonly solids: THREE.Mesh[];

  constructor({ frame, shapes, poses }: WorldObjects) {
    this.frame = frame;
    this.object.matrixAutoUpdate = false;
    this.solids = shapes.map(({ name, shape, size, color: [red, green, blue, opacity] }) => {
      const color = new THREE.Color().setRGB(red, green, blue, THREE.SRGBColorSpace);
      const material = new THREE.MeshStandardMaterial({ color, opacity, transparent: opacity < 1, roughness: 0.7 });
      const solid = new THREE.Mesh(geometryOf(shape, size), material);
      solid.name = name;
      return solid;
    });
    this.object.add(...this.solids);
    this.move(poses);
  }

  move(poses: number[][]): void {
    poses.forEach(([x, y, z, qx, qy, qz, qw], index) => {
      this.solids[index]?.position.set(x!, y!, z!);
      this.solids[index]?.quaternion.set(qx!, qy!, qz!, qw!);
    });
  }

  // Go to where the link of the frame is; without such a link the frame is the root of the scene.
  follow(model: RobotModel): void {
    const place = model.placeOf(this.frame);
    if (!place) return;
    this.object.matrix.copy(place);
    this.object.matrixWorldNeedsUpdate = true;
  }
}

export function geometryOf(shape: string, size: number[]): THREE.BufferGeometry {
  const [first, second, third] = size as [number, number, number];
  switch (shape) {
    case "box":
      return new THREE.BoxGeometry(first, second, third);
    case "cylinder":
      return new THREE.CylinderGeometry(first, first, second, 32).rotateX(Math.PI / 2); // its axis is z
    case "sphere":
      return new THREE.SphereGeometry(first, 24, 16);
    default:
      return new THREE.BoxGeometry(MESH_EDGE, MESH_EDGE, MESH_EDGE);
  }
}
