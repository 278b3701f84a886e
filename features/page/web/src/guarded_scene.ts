// What the arms keep away from, as translucent solids at the links that carry them.

import * as THREE from "three";
import type { GuardedSolid } from "./messages";
import type { RobotModel } from "./robot_model";
import { geometryOf } from "./scene_objects";

const COLOR = 0xd9822b;
const OPACITY = 0.35;
const PLANE_EDGE = 2; // of the part of a plane that is drawn, m

export class GuardedScene {
  readonly object = new THREE.Group();
  private places: { frame: string; holder: THREE.Group }[] = [];

  show(solids: GuardedSolid[]): void {
    this.object.traverse((each) => {
      if (!(each instanceof THREE.Mesh)) return;
      each.geometry.dispose();
      each.material.dispose();
    });
    this.object.clear();
    this.places = solids.map(({ name, shape, size, pose: [x, y, z, qx, qy, qz, qw], frame }) => {
      const isPlane = shape === "plane";
      const geometry = isPlane ? new THREE.PlaneGeometry(PLANE_EDGE, PLANE_EDGE) : geometryOf(shape, size);
      const side = isPlane ? THREE.DoubleSide : THREE.FrontSide;
      const material = new THREE.MeshStandardMaterial({ color: COLOR, opacity: OPACITY, transparent: true, depthWrite: false, side });
      const solid = new THREE.Mesh(geometry, material);
      solid.name = name;
      solid.position.set(x!, y!, z!);
      solid.quaternion.set(qx!, qy!, qz!, qw!);
      const holder = new THREE.Group();
      holder.matrixAutoUpdate = false;
      holder.add(solid);
      this.object.add(holder);
      return { frame, holder };
    });
  }

  // Go to where the links are; without such a link the root of the scene is the frame.
  follow(model: RobotModel): void {
    for (const { frame, holder } of this.places) {
      const place = model.placeOf(frame);
      if (!place) continue;
      holder.matrix.copy(place);
      holder.matrixWorldNeedsUpdate = true;
    }
  }
}
