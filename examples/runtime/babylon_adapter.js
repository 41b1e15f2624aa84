// Pose keys in Babylon.js. Imports nothing but the network: it works with any copy of Babylon.js that loaded the file.

import {NAME, PoseKeys, networkInExtension, networkInExtras} from './pose_keys.js';

/** @typedef {import('./pose_keys.js').Network<string>} Network */

/**
 * The part of Babylon.js that is used here.
 * @typedef {object} TransformNode
 * @property {string} name
 * @property {any} metadata
 * @property {any} parent
 * @property {{toArray: (array: any, offset: number) => unknown}} rotationQuaternion
 * @property {(force: boolean) => {m: ArrayLike<number>}} computeWorldMatrix
 * @typedef {{numTargets: number, getTarget: (index: number) => {influence: number}}} MorphTargetManager
 * @typedef {TransformNode & {skeleton: any, morphTargetManager: MorphTargetManager | null}} Mesh
 */

/**
 * Drivers of all garments in a loaded file.
 *
 * @param {{meshes: any[], transformNodes: any[]}} loaded what ImportMeshAsync and LoadAssetContainerAsync give
 * @returns {Driver[]} none where the file carries no network, or only one of a later version
 * @throws {Error} where a network is broken or the file lacks one of its joints
 */
export function findPoseKeys({meshes, transformNodes}) {
  /** @type {Map<string | Network, {network: Network | null, driven: Mesh[]}>} */
  const garments = new Map();
  for (const node of [...meshes, ...transformNodes]) {
    const source = carried(node);
    if (source && !garments.has(source)) garments.set(source, {network: parsed(source), driven: []});
  }
  for (const mesh of meshes) {
    if (!mesh.skeleton || !mesh.morphTargetManager) continue;
    const fits = (/** @type {any} */ {network}) => outputs(network) <= mesh.morphTargetManager.numTargets;
    const above = carriedAbove(mesh), garment = above ? garments.get(above) : [...garments.values()].find(fits);
    if (garment && fits(garment)) garment.driven.push(mesh);
  }
  const joints = new Map(transformNodes.map(node => [node.name, node])), drivers = [];
  for (const {network, driven} of garments.values())
    if (network && driven.length)
      drivers.push(new Driver(network, network.joints.map(name => joints.get(name) ?? missing(name)), driven));
  return drivers;
}

/**
 * Call it once, before loading, to read the extension too. Without it only the copy in the extras is found, which
 * nearly all files have.
 * @param {(name: string, isGLTFExtension: boolean, factory: (loader: any) => any) => void} registerGLTFExtension
 *   of @babylonjs/loaders/glTF/2.0
 */
export function registerPoseKeys(registerGLTFExtension) {
  registerGLTFExtension(NAME, true, loader => ({
    name: NAME,
    enabled: true,
    dispose() {},
    /** @param {string} context @param {any} node @param {(node: TransformNode) => void} assign */
    loadNodeAsync(context, node, assign) {
      const extension = loader.gltf.meshes?.[node.mesh]?.extensions?.[NAME];
      return extension ? loadNode(loader, context, node, assign, extension) : null;
    },
  }));
}

/**
 * @param {any} loader
 * @param {string} context
 * @param {any} node
 * @param {(node: TransformNode) => void} assign
 * @param {any} extension
 */
async function loadNode(loader, context, node, assign, extension) {
  const loading = loader.loadNodeAsync(context, node, assign);
  const indices = extension.layers.flatMap((/** @type {any} */ layer) => [layer.weight, layer.bias]);
  const arrays = new Map(await Promise.all(indices.map(async (/** @type {number} */ index) =>
    [index, await loader._loadFloatAccessorAsync(`/accessors/${index}`, loader.gltf.accessors[index])])));
  const network = networkInExtension(extension, index => arrays.get(index));
  const loaded = await loading;
  const names = network?.joints.map(joint => loader.gltf.nodes[joint].name);
  if (network) loaded.metadata = {...loaded.metadata, [NAME]: {...network, joints: names}};
  return loaded;
}

/** @param {TransformNode} node @returns {string | Network | undefined} */
function carried(node) {
  return node.metadata?.gltf?.extras?.[NAME] ?? node.metadata?.[NAME];
}

/** @param {string | Network} source */
function parsed(source) {
  return typeof source === 'string' ? networkInExtras(source) : source;
}

/** @param {Network | null} network */
function outputs(network) {
  return network?.layers.at(-1)?.bias.length;
}

/**
 * Where a mesh has several materials, its network is on the node above. Babylon.js moves skinned meshes up to its root:
 * where a tool had put the mesh below the node of the network, the number of morph targets must tell (see above).
 * @param {TransformNode | null} node
 */
function carriedAbove(node) {
  for (; node; node = node.parent) if (carried(node)) return carried(node);
}

/** @param {string} name @returns {never} */
function missing(name) {
  throw new Error(`${NAME}: the file has no joint ${name}; keep the names of nodes`);
}

/** Sets the morph weights of a garment's meshes. A glTF mesh of several materials is several meshes in Babylon.js. */
export class Driver {
  /**
   * @param {Network} network
   * @param {TransformNode[]} joints turned by their `rotationQuaternion`; whoever sets their `rotation` drops it
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
   * Call it each frame after the bones have moved, as in scene.onBeforeRenderObservable.
   * @param {number} [seconds] since the last call
   */
  update(seconds) {
    const {joints, meshes, rotations} = this;
    for (let i = 0; i < joints.length; i++) joints[i].rotationQuaternion.toArray(rotations, 4 * i);
    const keys = this.evaluator.evaluate(joints[0].computeWorldMatrix(true).m, rotations, seconds);
    for (let i = 0; i < meshes.length; i++) setInfluences(meshes[i].morphTargetManager, keys);
  }
}

/** @param {MorphTargetManager | null} targets @param {Float64Array} keys */
function setInfluences(targets, keys) {
  for (let i = 0; targets && i < targets.numTargets; i++) targets.getTarget(i).influence = keys[i] ?? 0;
}
