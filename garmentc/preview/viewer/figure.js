// The loaded outfit: its skeleton, its morph weights, and what moves them.

import {
  AnimationMixer, Box3, Euler, GLTFLoader, MeshBasicMaterial, MeshoptDecoder, Quaternion, SkeletonHelper, SkinnedMesh, Vector3,
} from 'three';
import {findPoseKeys} from 'garmentc/runtime';
import {Body} from 'garmentc/body';

const EASE = 0.35; // seconds from pose to pose

/** What sets the morph weights: keyframes of the animation, the pose-key network, or sliders. */
export const BAKED = 'animation', NETWORK = 'network', BY_HAND = 'by hand';

export class Figure {
  /** Read a .glb (ArrayBuffer). `content` is what garmentc/preview/page.py wrote beside it. */
  static async load(buffer, content) {
    const gltf = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).parseAsync(buffer, '');
    const bones = await Promise.all(content.joints.map(index => gltf.parser.getDependency('node', index)));
    return new Figure(gltf, bones, await findPoseKeys(gltf), content.body);
  }

  constructor({scene, animations}, bones, drivers, body) {
    this.scene = scene;
    this.clips = animations;
    this.bones = bones;
    this.drivers = drivers;
    this.meshes = [];
    this.bodyMeshes = [];
    scene.traverse(object => {
      if (object.isMesh) (isBody(object) ? this.bodyMeshes : this.meshes).push(object);
    });
    for (const mesh of [...this.meshes, ...this.bodyMeshes]) {
      mesh.frustumCulled = false; // three.js takes bounds from the rest pose
      mesh.castShadow = mesh.receiveShadow = true;
    }
    this.body = body && !this.bodyMeshes.length ? new Body(body, bones) : null;
    if (this.body) {
      this.scene.add(this.body.mesh);
      this.bodyMeshes.push(this.body.mesh);
    }
    this.wires = this.meshes.map(wire);
    this.skeleton = new SkeletonHelper(bones[0]);
    this.skeleton.material.depthTest = false;
    this.skeleton.visible = false;

    this.mixer = new AnimationMixer(scene);
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.posed = false; // by hand, not by the animation
    this.keys = animations.length ? BAKED : drivers.length ? NETWORK : BY_HAND;
    this.way = null;
    this.wanted = null;
    this.point = new Vector3();
    this.sole = this.soleHeight();
    if (animations.length) this.choose(0);
  }

  /** Meshes with morph targets, one of each group that shares its weights, and how many targets they have. */
  get morphed() {
    const groups = new Map();
    for (const mesh of this.meshes)
      if (mesh.morphTargetInfluences?.length) {
        const owner = mesh.parent === this.scene ? mesh : mesh.parent;
        groups.set(owner, [...groups.get(owner) ?? [], mesh]);
      }
    return [...groups.values()];
  }

  get duration() {
    return this.clip?.duration ?? 0;
  }

  choose(index) {
    this.mixer.stopAllAction();
    this.clip = this.clips[index];
    this.mixer.clipAction(this.clip).play();
    this.seek(0);
  }

  get moving() {
    return this.playing || this.way !== null;
  }

  play() {
    this.playing = true;
    this.seek(this.time);
  }

  /** Choose what sets the morph weights. */
  driveBy(source) {
    this.keys = source;
    this.wanted = null;
    if (source === BAKED) this.seek(this.time);
  }

  /** Show the animation at a time in seconds. */
  seek(time) {
    this.posed = false;
    this.keys = this.wanted ?? this.keys;
    this.wanted = null;
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.way = null;
    const weights = this.keys === BY_HAND ? this.meshes.map(mesh => mesh.morphTargetInfluences?.slice()) : [];
    // At the very end three.js would begin again.
    this.mixer.setTime(Math.min(this.time, this.duration - 1e-6));
    weights.forEach((values, i) => values?.forEach((value, k) => { this.meshes[i].morphTargetInfluences[k] = value; }));
  }

  /** Leave the animation: the pose is set by hand from now on. */
  pause() {
    this.playing = false;
    this.posed = true;
    if (this.keys !== BAKED) return;
    this.keys = this.drivers.length ? NETWORK : BY_HAND;
    this.wanted = BAKED; // once the animation goes on
  }

  /** Go to a pose: 24 axis-angle vectors in radians. */
  goTo(pose) {
    this.pause();
    const axis = new Vector3();
    const to = pose.map(([x, y, z]) => {
      const angle = axis.set(x, y, z).length();
      return new Quaternion().setFromAxisAngle(angle ? axis.divideScalar(angle) : axis.set(1, 0, 0), angle);
    });
    const from = this.bones.map(bone => bone.quaternion.clone());
    this.way = {from, to, seconds: 0};
  }

  /** Turn a joint, by Euler angles in radians. */
  turn(joint, x, y, z) {
    this.pause();
    this.way = null;
    this.bones[joint].quaternion.setFromEuler(new Euler(x, y, z, 'XYZ'));
  }

  angles(joint) {
    return new Euler().setFromQuaternion(this.bones[joint].quaternion, 'XYZ').toArray().slice(0, 3);
  }

  /** Set one morph weight of a group of meshes. */
  setMorph(meshes, target, weight) {
    this.keys = BY_HAND;
    this.wanted = null;
    for (const mesh of meshes) mesh.morphTargetInfluences[target] = weight;
  }

  /** Height of the lowest joint of the legs. */
  get lowest() {
    const feet = this.bones.filter((_, joint) => [4, 5, 7, 8, 10, 11].includes(joint)); // knees, ankles, feet, as SMPL counts
    return Math.min(...feet.map(bone => bone.getWorldPosition(this.point).y));
  }

  /** How far the soles are below that joint, in the rest pose. */
  soleHeight() {
    this.scene.updateMatrixWorld(true);
    if (!this.bodyMeshes.length) return 0.03;
    const box = new Box3();
    for (const mesh of this.bodyMeshes) box.expandByObject(mesh, true);
    return this.lowest - box.min.y;
  }

  /** Lift or lower the figure until it stands at a height. */
  standOn(ground) {
    const [pelvis] = this.bones, place = pelvis.getWorldPosition(this.point.clone());
    place.y += ground + this.sole - this.lowest;
    pelvis.position.copy(pelvis.parent.worldToLocal(place));
  }

  /** Move on by some seconds. */
  update(seconds) {
    if (this.playing) this.seek((this.time + seconds * this.speed) % this.duration);
    if (this.way) this.goOn(seconds);
    if (this.keys === NETWORK) for (const driver of this.drivers) driver.update(seconds);
    this.body?.update();
  }

  goOn(seconds) {
    const {from, to} = this.way;
    this.way.seconds += seconds;
    const linear = Math.min(this.way.seconds / EASE, 1), share = linear * linear * (3 - 2 * linear);
    this.bones.forEach((bone, i) => bone.quaternion.slerpQuaternions(from[i], to[i], share));
    if (linear === 1) this.way = null;
  }
}

function isBody(object) {
  for (let at = object; at; at = at.parent) if (at.userData.GARMENTC_role === 'body') return true;
  return false;
}

/** The edges of a mesh's triangles, moving with it. */
function wire(mesh) {
  const material = new MeshBasicMaterial({color: 0x10151c, wireframe: true, transparent: true, opacity: 0.35});
  Object.assign(material, {polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -1});
  const lines = new SkinnedMesh(mesh.geometry, material);
  if (mesh.isSkinnedMesh) lines.bind(mesh.skeleton, mesh.bindMatrix);
  lines.morphTargetInfluences = mesh.morphTargetInfluences;
  lines.morphTargetDictionary = mesh.morphTargetDictionary;
  lines.frustumCulled = false;
  lines.visible = false;
  mesh.add(lines);
  return lines;
}
