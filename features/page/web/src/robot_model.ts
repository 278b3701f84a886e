// The robot of a URDF as a tree of three.js objects, posed by joint positions.

import * as THREE from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import URDFLoader, { type URDFJoint, type URDFRobot } from "urdf-loader";
import type { Description, Sample } from "./messages";

const CAPSULE_RADIUS = 0.12; // of the mean distance between joints
const CAPSULE_COLOR = 0xb9c0c8;
const FAULT = new THREE.Color(0xd11a1a);

export class RobotModel {
  readonly object = new THREE.Group(); // z upwards, moved by the odometry of a base
  private readonly robot: URDFRobot;
  private readonly joints: (URDFJoint | undefined)[]; // by axis
  private readonly faulty = new Set<number>();
  private missing: { name: string; link: string }[] = []; // meshes

  constructor(
    private readonly description: Description,
    onMeshes: () => void, // called when the files of all meshes are loaded
  ) {
    const loader = new URDFLoader(new THREE.LoadingManager(onMeshes));
    const loadOther = loader.loadMeshCb;
    const document = this.withMeshUrls(description);
    loader.loadMeshCb = (url, manager, material, done) => {
      const loaded = (mesh: THREE.Object3D, error?: Error): void => {
        if (error) this.miss(document, url);
        else if (/\.dae$/i.test(url)) drawOpaque(mesh);
        done(mesh, error);
      };
      if (!/\.(glb|gltf)$/i.test(url)) loadOther(url, manager, material, loaded);
      else new GLTFLoader(manager).load(url, ({ scene }) => loaded(scene), undefined, (error) => loaded(undefined!, error as Error));
    };
    this.robot = loader.parse(document);
    for (const joint of Object.values(this.robot.joints)) joint.ignoreLimits = true;
    this.joints = description.axes.map(({ joint }) => this.robot.joints[joint]);
    if (!description.urdf.includes("<visual")) drawCapsules(this.robot, Object.keys(this.robot.links));
    this.object.add(this.robot);
  }

  // Draw capsules for the links whose meshes are missing; return the names of these meshes.
  drawMissing(): string[] {
    const { missing } = this;
    this.missing = [];
    drawCapsules(this.robot, new Set(missing.map(({ link }) => link)));
    return [...new Set(missing.map(({ name }) => name))];
  }

  // Give each solid a material of its own: a fault colours one link.
  ownMaterials(): void {
    this.robot.traverse((each) => {
      if (!(each instanceof THREE.Mesh) || each.userData["isOwn"]) return;
      each.material = standardMaterial(each.material);
      each.userData["isOwn"] = true;
    });
  }

  show(sample: Sample): void {
    this.joints.forEach((joint, axis) => {
      const position = sample.position(axis);
      if (joint && Number.isFinite(position)) joint.setJointValue(position);
    });
    if (Number.isFinite(sample.closed)) {
      for (const { name, open, closed } of this.description.fingers) {
        this.robot.setJointValue(name, open + (closed - open) * sample.closed);
      }
    }
    const [x, y, heading] = sample.pose;
    if (Number.isFinite(x)) {
      this.object.position.set(x, y, 0);
      this.object.rotation.set(0, 0, heading);
    }
  }

  // A second robot of the same solids, which moves on its own.
  copy(): URDFRobot {
    const robot = this.robot.clone();
    for (const joint of Object.values(robot.joints)) joint.ignoreLimits = true;
    return robot;
  }

  // Frame of a link where the robot stands; undefined where there is no such link.
  placeOf(name: string): THREE.Matrix4 | undefined {
    this.object.updateMatrix();
    const frame = this.frameOf(name);
    return frame && this.object.matrix.clone().multiply(frame);
  }

  // Frame of a link in the root of the URDF; undefined where there is no such link.
  frameOf(name: string): THREE.Matrix4 | undefined {
    const link = this.robot.links[name];
    if (!link) return undefined;
    link.updateWorldMatrix(true, false);
    return this.robot.matrixWorld.clone().invert().multiply(link.matrixWorld);
  }

  // Colour the link that a joint moves; returns whether something has changed.
  setFault(axis: number, on: boolean): boolean {
    const joint = this.joints[axis];
    if (!joint || this.faulty.has(axis) === on) return false;
    if (on) this.faulty.add(axis);
    else this.faulty.delete(axis);
    ownMeshes(joint).forEach((mesh) => {
      const material = mesh.material as THREE.MeshStandardMaterial;
      const normal = mesh.userData["color"] as THREE.Color | undefined;
      mesh.userData["color"] ??= material.color.clone();
      material.color.copy(on ? FAULT : (normal ?? material.color));
      material.emissive.set(on ? 0x500000 : 0);
    });
    return true;
  }

  private withMeshUrls({ urdf, meshes }: Description): Document {
    const document = new DOMParser().parseFromString(urdf, "text/xml");
    for (const mesh of document.querySelectorAll("mesh")) {
      const name = mesh.getAttribute("filename") ?? "";
      const url = meshes[name];
      if (url) mesh.setAttribute("filename", url);
      else {
        if (mesh.closest("visual")) this.missing.push({ name, link: linkOf(mesh) });
        mesh.closest("visual, collision")?.remove();
      }
    }
    return document;
  }

  // A file that cannot be read is as good as missing.
  private miss(document: Document, url: string): void {
    for (const mesh of document.querySelectorAll("mesh")) {
      if (mesh.getAttribute("filename") === url) this.missing.push({ name: url, link: linkOf(mesh) });
    }
  }
}

function linkOf(mesh: Element): string {
  return mesh.closest("link")?.getAttribute("name") ?? "";
}

// Collada files with <transparency>0</transparency> mean opaque far more often than invisible, which A_ONE says.
function drawOpaque(scene: THREE.Object3D): void {
  scene.traverse((each) => {
    if (!(each instanceof THREE.Mesh)) return;
    for (const material of Array.isArray(each.material) ? each.material : [each.material as THREE.Material]) {
      if (material.opacity > 0) continue;
      material.opacity = 1;
      material.transparent = false;
    }
  });
}

function standardMaterial(material: THREE.Material | THREE.Material[]): THREE.Material {
  const first = Array.isArray(material) ? material[0] : material;
  if (first instanceof THREE.MeshStandardMaterial) return first.clone(); // of a glTF, with its textures
  const color = first && "color" in first ? (first.color as THREE.Color) : new THREE.Color(0xcccccc);
  return new THREE.MeshStandardMaterial({
    color,
    roughness: 0.55,
    metalness: 0.1,
    transparent: first?.transparent ?? false,
    opacity: first?.opacity ?? 1,
  });
}

// Meshes that move with a joint, without those beyond the next joint.
function ownMeshes(joint: URDFJoint): THREE.Mesh[] {
  const found: THREE.Mesh[] = [];
  const visit = (each: THREE.Object3D): void => {
    if (each !== joint && "isURDFJoint" in each && (each as URDFJoint).jointType !== "fixed") return;
    if (each instanceof THREE.Mesh) found.push(each);
    each.children.forEach(visit);
  };
  visit(joint);
  return found;
}

// Capsules from the origin of each link to the joints that it carries; a ball for a link at the end.
function drawCapsules(robot: URDFRobot, links: Iterable<string>): void {
  robot.updateMatrixWorld(true);
  const joints = Object.values(robot.joints).filter((each) => each.position.length() > 1e-3);
  const mean = joints.reduce((sum, each) => sum + each.position.length(), 0) / (joints.length || 1);
  const radius = CAPSULE_RADIUS * (mean || 1);
  const material = new THREE.MeshStandardMaterial({ color: CAPSULE_COLOR });
  for (const link of links) {
    const carried = joints.filter((each) => each.parent === robot.links[link]);
    for (const joint of carried) {
      const capsule = new THREE.Mesh(new THREE.CapsuleGeometry(radius, joint.position.length(), 6, 16), material);
      capsule.position.copy(joint.position).multiplyScalar(0.5);
      capsule.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), joint.position.clone().normalize());
      joint.parent?.add(capsule);
    }
    if (!carried.length) robot.links[link]?.add(new THREE.Mesh(new THREE.SphereGeometry(1.3 * radius, 16, 12), material));
  }
}
