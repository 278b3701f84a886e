// The robot of a URDF as a tree of three.js objects, posed by joint positions.

import * as THREE from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import URDFLoader, { type URDFJoint, type URDFRobot } from "urdf-loader";
import type { AxisDescription, Description, Sample } from "./messages";

const CAPSULE_RADIUS = 0.12; // of the mean distance between joints
const FAULT = new THREE.Color(0xd11a1a);

export class RobotModel {
  readonly object = new THREE.Group(); // z upwards, moved by the odometry of a base
  private readonly robot: URDFRobot;
  private readonly joints: (URDFJoint | undefined)[]; // by axis
  private readonly faulty = new Set<number>();

  constructor(
    private readonly description: Description,
    onMeshes: () => void, // called when the files of all meshes are loaded
  ) {
    const loader = new URDFLoader(new THREE.LoadingManager(onMeshes));
    const loadOther = loader.loadMeshCb;
    loader.loadMeshCb = (url, manager, material, done) => {
      if (!/\.(glb|gltf)$/i.test(url)) loadOther(url, manager, material, done);
      else new GLTFLoader(manager).load(url, ({ scene }) => done(scene), undefined, (error) => done(undefined!, error as Error));
    };
    this.robot = loader.parse(withMeshUrls(description));
    for (const joint of Object.values(this.robot.joints)) joint.ignoreLimits = true;
    this.joints = description.axes.map((axis) => this.jointOf(axis));
    if (!description.urdf.includes("<visual")) drawCapsules(this.robot);
    this.object.add(this.robot);
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

  // The joint with the name of an axis, or with all words of a wheel's name such as "front left wheel".
  private jointOf({ name, kind }: AxisDescription): URDFJoint | undefined {
    if (kind !== "wheel") return this.robot.joints[name];
    const wheels = Object.values(this.robot.joints).filter((each) => each.jointType === "continuous");
    return wheels.find((each) => name.split(" ").every((word) => each.urdfName.toLowerCase().includes(word)));
  }
}

function withMeshUrls({ urdf, meshes }: Description): Document {
  const document = new DOMParser().parseFromString(urdf, "text/xml");
  for (const mesh of document.querySelectorAll("mesh")) {
    const url = meshes[mesh.getAttribute("filename") ?? ""];
    if (url) mesh.setAttribute("filename", url);
    else mesh.closest("visual, collision")?.remove();
  }
  return document;
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

// A robot without solids: capsules between the origins of its joints.
function drawCapsules(robot: URDFRobot): void {
  robot.updateMatrixWorld(true);
  const joints = Object.values(robot.joints).filter((each) => each.position.length() > 1e-3);
  const mean = joints.reduce((sum, each) => sum + each.position.length(), 0) / (joints.length || 1);
  const radius = CAPSULE_RADIUS * mean;
  const material = new THREE.MeshStandardMaterial({ color: 0xb9c0c8 });
  for (const joint of joints) {
    const length = joint.position.length();
    const capsule = new THREE.Mesh(new THREE.CapsuleGeometry(radius, length, 6, 16), material);
    capsule.position.copy(joint.position).multiplyScalar(0.5);
    const direction = joint.position.clone().normalize();
    capsule.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), direction);
    joint.parent?.add(capsule);
  }
}
