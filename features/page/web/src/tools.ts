// Poses of the tools: measured positions through the kinematics of the drawn robot.

import * as THREE from "three";
import { find, make, setText } from "./dom";
import type { Description, Sample } from "./messages";
import { signed, type Units } from "./units";
import type { View } from "./view";

interface Row {
  link: string;
  position: HTMLElement;
  rotation: HTMLElement;
}

export class ToolPanel {
  private readonly list = find("tools");
  private rows: Row[] = [];

  constructor(
    private readonly view: View,
    private readonly units: Units,
  ) {}

  describe({ tools }: Description): void {
    this.list.replaceChildren();
    this.rows = tools.map(({ link, base }) => this.addRow(link, base));
  }

  show(sample: Sample): void {
    for (const { link, position, rotation } of this.rows) {
      const frame = sample.hasPositions ? this.view.frameOf(link) : undefined;
      setText(position, frame ? this.positionText(frame) : "pose not known");
      setText(rotation, frame ? this.rotationText(frame) : "");
    }
  }

  private addRow(link: string, base: string): Row {
    const position = make("span", "number");
    const rotation = make("span", "number");
    this.list.append(make("li", "", make("strong", "", link), ` in ${base}`, position, rotation));
    return { link, position, rotation };
  }

  private positionText(frame: THREE.Matrix4): string {
    const { x, y, z } = new THREE.Vector3().setFromMatrixPosition(frame);
    return `x ${signed(x, 4)} y ${signed(y, 4)} z ${signed(z, 4)} m`;
  }

  // Roll, pitch and yaw about the fixed axes of the base.
  private rotationText(frame: THREE.Matrix4): string {
    const { x, y, z } = new THREE.Euler().setFromRotationMatrix(frame, "ZYX");
    const digits = this.units.digits("rad");
    const text = (angle: number): string => signed(angle * this.units.factor("rad"), digits);
    return `roll ${text(x)} pitch ${text(y)} yaw ${text(z)} ${this.units.name("rad")}`;
  }
}
