// Pose keys in three.js. Imports nothing but the network: it works with any copy of three.js that loaded the file.

import {NAME, PoseKeys, networkInExtension, networkInExtras} from './pose_keys.js';

/** @typedef {import('./pose_keys.js').Network<string>} Network */

/**
 * The part of three.js that is used here.
 * @typedef {object} Object3D
 * @property {string} name
 * @property {Record<string, any>} userData
 * @property {Object3D | null} parent
 * @property {{toArray: (array: any, offset: number) => unknown}} quaternion
 * @property {{elements: number[]}} matrixWorld
 * @property {(callback: (object: any) => void) => void} traverse
 * @property {(parents: boolean, children: boolean) => void} updateWorldMatrix
 * @typedef {Object3D & {isSkinnedMesh?: boolean, morphTargetInfluences?: number[]}} Mesh
 * @typedef {{json: any, getDependency: (type: string, index: number) => Promise<any>}} Parser
 */

/**
 * Drivers of all garments in a loaded file.
 *
 * @param {{scene: any, parser?: any}} gltf what GLTFLoader gives. For a copy of the scene (`SkeletonUtils.clone`) give
 *   `{scene: copy, parser: gltf.parser}`
 * @returns {Promise<Driver[]>} none where the file carries no network, or only one of a later version
 * @throws {Error} where a network is broken or the scene lacks one of its joints
 */
export async function findPoseKeys({scene, parser}) {
  /** @type {Map<Object3D, Mesh[]>} */
  const owners = new Map();
  scene.traverse((/** @type {Mesh} */ mesh) => {
    const owner = mesh.isSkinnedMesh && mesh.morphTargetInfluences ? ownerOf(mesh) : null;
    if (owner) owners.set(owner, [...owners.get(owner) ?? [], mesh]);
  });
  const drivers = [];
  for (const [owner, meshes] of owners) {
    const network = await networkOf(owner, parser);
    const outputs = network?.layers.at(-1)?.bias.length ?? Infinity;
    const driven = meshes.filter(mesh => (mesh.morphTargetInfluences?.length ?? 0) >= outputs);
    if (network && driven.length) drivers.push(new Driver(network, jointsOf(network, scene), driven));
  }
  return drivers;
}

/**
 * What carries the mesh's network: the mesh, its group where it has several materials, or a node above, where a tool
 * moved the mesh to a node below its own.
 * @param {Object3D} mesh
 */
function ownerOf(mesh) {
  /** @type {Object3D | null} */
  let owner = mesh;
  while (owner && !owner.userData[NAME] && !owner.userData.gltfExtensions?.[NAME]) owner = owner.parent;
  return owner;
}

/**
 * @param {Object3D} owner
 * @param {Parser} [parser]
 * @returns {Promise<Network | null>}
 */
async function networkOf(owner, parser) {
  const text = owner.userData[NAME], extension = owner.userData.gltfExtensions?.[NAME];
  if (text) return networkInExtras(text);
  if (!parser) return null;
  const indices = extension.layers.flatMap((/** @type {any} */ layer) => [layer.weight, layer.bias]);
  const arrays = new Map(await Promise.all(indices.map(async (/** @type {number} */ index) =>
    [index, (await parser.getDependency('accessor', index)).array])));
  const network = networkInExtension(extension, index => arrays.get(index));
  return network && {...network, joints: network.joints.map(node => parser.json.nodes[node].name)};
}

/**
 * @param {Network} network
 * @param {Object3D} scene
 * @returns {Object3D[]}
 */
function jointsOf({joints}, scene) {
  const byName = new Map();
  scene.traverse(object => byName.set(object.userData.name ?? object.name, object)); // `name` may have been altered
  return joints.map(name => byName.get(name) ?? missing(name));
}

/** @param {string} name @returns {never} */
function missing(name) {
  throw new Error(`${NAME}: the scene has no joint ${name}; keep the names of nodes`);
}

/** Sets the morph weights of a garment's meshes. A glTF mesh of several materials is several meshes in three.js. */
export class Driver {
  /**
   * @param {Network} network
   * @param {Object3D[]} joints whose rotations are read: other bones may stand in, if they turn as the file's do
   * @param {Mesh[]} meshes
   */
  constructor(network, joints, meshes) {
    this.joints = joints;
    this.meshes = meshes;
    /** @type {import('./pose_keys.js').Evaluator} */
    this.evaluator = new PoseKeys(network);
    /** @private */
    this.rotations = new Float64Array(4 * joints.length);
  }

  /**
   * Call it each frame after the bones have moved, before drawing.
   * @param {number} [seconds] since the last call
   */
  update(seconds) {
    const {joints, meshes, rotations} = this;
    for (let i = 0; i < joints.length; i++) joints[i].quaternion.toArray(rotations, 4 * i);
    joints[0].updateWorldMatrix(true, false);
    const keys = this.evaluator.evaluate(joints[0].matrixWorld.elements, rotations, seconds);
    for (let m = 0; m < meshes.length; m++) {
      const influences = /** @type {number[]} */ (meshes[m].morphTargetInfluences);
      for (let i = 0; i < influences.length; i++) influences[i] = keys[i] ?? 0; // what only animations use: 0
    }
  }
}
