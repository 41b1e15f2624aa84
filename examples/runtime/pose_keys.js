// The pose-key network of a garment compiled by garmentc: from the rotations of the joints to morph weights.
//
// Knows no engine and needs no package; three.js and babylon.js beside it connect it to these engines.
// The format and the mathematics: docs/GARMENTC_mesh_pose_keys.md.

/** Of the extension of the mesh, and of the string in the extras of its node. */
export const NAME = 'GARMENTC_mesh_pose_keys';

const VERSION = 1, JOINTS = 24;
const INPUTS = new Map([['gravity_axis_angle', 3 * JOINTS], ['gravity_joints', 6 * JOINTS - 3]]); // by encoding
const PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]; // SMPL's tree
const ACTIVATIONS = ['linear', 'relu', 'normalized_relu', 'nonnegative'];
const EPSILON = 1e-6; // of normalized_relu: never 0 / 0

/** kernel.wat, assembled (WebAssembly in base64): JavaScript has no SIMD and takes almost three times as long. */
const KERNEL = `
AGFzbQEAAAABCQFgBX9/f39/AAIMAQAGbWVtb3J5AgABAwIBAAcOAQphY2N1bXVsYXRlAAAK4QEB3gECA38FewNAIAD9AAQAIQkg
AP0ABBAhCiAA/QAEICELIAD9AAQwIQxBACEFA0AgAyAFQQN0av0KAwAhCCAGIAIgBUECdGooAgBqIQcgCSAIIAf9XQMA/V/98gH9
8AEhCSAKIAggB/1dAwj9X/3yAf3wASEKIAsgCCAH/V0DEP1f/fIB/fABIQsgDCAIIAf9XQMY/V/98gH98AEhDCAFQQFqIgUgBEkN
AAsgACAJ/QsEACAAIAr9CwQQIAAgC/0LBCAgACAM/QsEMCAGQSBqIQYgAEHAAGoiACABSQ0ACws=`;
const ROWS = 8; // outputs that it computes at a time

/**
 * activation(weight · x + bias); `weight` row after row, one row for each output.
 * @typedef {{weight: Float32Array, bias: Float32Array, activation: string}} Layer
 */

/**
 * @template Joint what the joints are given by: their nodes' names in the extras, indices in the extension
 * @typedef {{encoding: string, joints: Joint[], layers: Layer[]}} Network
 */

/**
 * Drives morph weights. An evaluator may remember the motion (recurrent networks will): give it the seconds since the
 * last call, and call `reset` where the pose jumps. `PoseKeys`, the only kind so far, looks at the present pose alone.
 * @typedef {object} Evaluator
 * @property {Float64Array} keys the morph weights that `evaluate` found last: it returns this array
 * @property {(pelvis: ArrayLike<number>, rotations: ArrayLike<number>, seconds?: number) => Float64Array} evaluate
 * @property {() => void} reset
 */

/**
 * Read the string in the extras of a node.
 * @param {string} text
 * @returns {Network<string> | null} null where its version, encoding or an activation is not known
 * @throws {Error} where it is broken
 */
export function networkInExtras(text) {
  return network(JSON.parse(text), (/** @type {string} */ base64) => {
    const bytes = Uint8Array.from(atob(base64), character => character.charCodeAt(0));
    const view = new DataView(bytes.buffer); // little-endian, whatever this machine is
    return Float32Array.from({length: bytes.length / 4}, (_, i) => view.getFloat32(4 * i, true));
  });
}

/**
 * Read the extension of a mesh.
 * @param {any} extension `mesh.extensions.GARMENTC_mesh_pose_keys` in the glTF's JSON
 * @param {(index: number) => Float32Array} accessor the numbers of an accessor
 * @returns {Network<number> | null} null where its version, encoding or an activation is not known
 * @throws {Error} where it is broken
 */
export function networkInExtension(extension, accessor) {
  return network(extension, accessor);
}

/**
 * @param {any} entry
 * @param {(where: any) => Float32Array} numbers
 * @returns {Network<any> | null}
 */
function network(entry, numbers) {
  const known = (/** @type {any} */ layer) => ACTIVATIONS.includes(layer.activation);
  let inputs = INPUTS.get(entry.encoding);
  if (entry.version !== VERSION || !inputs || !entry.layers.every(known)) return null;
  const layers = entry.layers.map((/** @type {any} */ layer) =>
    ({weight: numbers(layer.weight), bias: numbers(layer.bias), activation: layer.activation}));
  if (entry.joints.length !== JOINTS || !layers.length)
    throw new Error(`${NAME}: ${entry.joints.length} joints and ${layers.length} layers, not ${JOINTS} and some`);
  for (const {weight, bias} of layers) {
    if (weight.length !== inputs * bias.length || !weight.every(Number.isFinite) || !bias.every(Number.isFinite))
      throw new Error(`${NAME}: a layer does not hold ${inputs} × ${bias.length} finite weights`);
    inputs = bias.length;
  }
  return {encoding: entry.encoding, joints: entry.joints, layers};
}

/**
 * Evaluates a network. It allocates nothing after construction.
 *
 * Weights lie column after column: whole columns are skipped for inputs that are 0, as most are after a ReLU.
 * @implements {Evaluator}
 */
export class PoseKeys {
  /** @param {Network<unknown>} network */
  constructor({encoding, layers}) {
    let bytes = 0, inputs = /** @type {number} */ (INPUTS.get(encoding)), input = reserve(8 * inputs);
    /** @private */
    this.encode = encoding === 'gravity_joints' ? encodeWithGravity : encode;
    const plan = layers.map(({weight, bias, activation}) => {
      const outputs = bias.length, rows = Math.ceil(outputs / ROWS) * ROWS;
      const output = reserve(8 * rows), columns = reserve(4 * rows * inputs);
      const layer = {input, inputs, output, outputs, columns, rows, weight, bias: Float64Array.from(bias), activation};
      [input, inputs] = [output, outputs];
      return layer;
    });
    const most = Math.max(...plan.map(layer => layer.inputs));
    /** @private addresses: inputs that are not 0, and their columns' addresses */
    this.used = {values: reserve(8 * most), columns: reserve(4 * most)};
    const memory = new WebAssembly.Memory({initial: Math.ceil(bytes / 65536)}); // pages of 64 KiB
    const floats = new Float32Array(memory.buffer);
    /** @private */
    this.doubles = new Float64Array(memory.buffer);
    /** @private */
    this.integers = new Int32Array(memory.buffer);
    /** @private */
    this.layers = plan.map(({weight, ...layer}) => {
      for (let i = 0; i < weight.length; i++)
        floats[layer.columns / 4 + (i % layer.inputs) * layer.rows + Math.floor(i / layer.inputs)] = weight[i];
      return layer;
    });
    const module = new WebAssembly.Module(Uint8Array.from(atob(KERNEL), character => character.charCodeAt(0)));
    /** @private @type {any} */
    this.kernel = new WebAssembly.Instance(module, {'': {memory}}).exports;
    this.keys = new Float64Array(memory.buffer, input, inputs);

    /** @param {number} size in bytes @returns {number} address */
    function reserve(size) {
      bytes += Math.ceil(size / 16) * 16;
      return bytes - Math.ceil(size / 16) * 16;
    }
  }

  /**
   * @param {ArrayLike<number>} pelvis 16 numbers, the pelvis' matrix to the world, column after column
   * @param {ArrayLike<number>} rotations 24 × (x, y, z, w), the joints' local quaternions (the pelvis' is unused)
   * @returns {Float64Array} `keys`, one for each morph target
   */
  evaluate(pelvis, rotations) {
    this.encode(this.doubles, pelvis, rotations);
    for (let i = 0; i < this.layers.length; i++) this.run(this.layers[i]);
    return this.keys;
  }

  /** There is nothing to forget. */
  reset() {}

  /** @private @param {PoseKeys['layers'][number]} layer */
  run({input, inputs, output, outputs, columns, rows, bias, activation}) {
    const {doubles, integers, used} = this;
    const x = input >> 3, y = output >> 3, values = used.values >> 3, starts = used.columns >> 2;
    let count = 0;
    for (let i = 0; i < inputs; i++) {
      const value = doubles[x + i];
      if (value === 0) continue;
      doubles[values + count] = value;
      integers[starts + count++] = columns + 4 * rows * i;
    }
    doubles.set(bias, y);
    if (count) this.kernel.accumulate(output, output + 8 * rows, used.columns, used.values, count);
    if (activation === 'linear') return;
    if (activation === 'nonnegative') {
      let least = Infinity;
      for (let i = y; i < y + outputs; i++) least = Math.min(least, doubles[i]);
      for (let i = y; i < y + outputs; i++) doubles[i] -= least;
      return;
    }
    let sum = EPSILON;
    for (let i = y; i < y + outputs; i++) sum += doubles[i] = Math.max(doubles[i], 0);
    if (activation === 'relu') return;
    for (let i = y; i < y + outputs; i++) doubles[i] /= sum;
  }
}

/**
 * Encoding `gravity_axis_angle`: up as the pelvis sees it minus up at rest, then each joint's axis times its angle.
 * @param {Float64Array} x 72 numbers to write
 * @param {ArrayLike<number>} pelvis
 * @param {ArrayLike<number>} rotations
 */
function encode(x, pelvis, rotations) {
  encodePelvis(x, pelvis);
  for (let joint = 1; joint < JOINTS; joint++) encodeAxisAngle(x, 3 * joint, rotations, joint);
}

/**
 * Encoding `gravity_joints`: up as the pelvis sees it minus up at rest, then of each joint the same and its axis times
 * its angle. What the parent of a joint sees, turned back by the rotation of the joint, is what the joint sees.
 * @param {Float64Array} x 141 numbers to write
 * @param {ArrayLike<number>} pelvis
 * @param {ArrayLike<number>} rotations
 */
function encodeWithGravity(x, pelvis, rotations) {
  encodePelvis(x, pelvis);
  for (let joint = 1; joint < JOINTS; joint++) {
    const to = 6 * joint - 3, parent = PARENTS[joint], from = parent ? 6 * parent - 3 : 0, at = 4 * joint;
    const a = rotations[at], b = rotations[at + 1], c = rotations[at + 2], w = rotations[at + 3];
    const double = 2 / (a * a + b * b + c * c + w * w), ux = x[from], uy = x[from + 1] + 1, uz = x[from + 2];
    const p = b * uz - c * uy, q = c * ux - a * uz, r = a * uy - b * ux; // axis × up
    x[to] = ux + double * (b * r - c * q - w * p);
    x[to + 1] = uy + double * (c * p - a * r - w * q) - 1;
    x[to + 2] = uz + double * (a * q - b * p - w * r);
    encodeAxisAngle(x, to + 3, rotations, joint);
  }
}

/**
 * The first three numbers.
 * @param {Float64Array} x
 * @param {ArrayLike<number>} pelvis
 */
function encodePelvis(x, pelvis) {
  for (let i = 0; i < 3; i++) { // the second row of the matrix, its columns freed of scale
    const a = pelvis[4 * i], b = pelvis[4 * i + 1], c = pelvis[4 * i + 2];
    x[i] = b / Math.sqrt(a * a + b * b + c * c) - (i === 1 ? 1 : 0);
  }
}

/**
 * A joint's axis times its angle, the shorter way round.
 * @param {Float64Array} x
 * @param {number} to where in `x`
 * @param {ArrayLike<number>} rotations
 * @param {number} joint
 */
function encodeAxisAngle(x, to, rotations, joint) {
  const at = 4 * joint, a = rotations[at], b = rotations[at + 1], c = rotations[at + 2], w = rotations[at + 3];
  const length = Math.sqrt(a * a + b * b + c * c), sign = w < 0 ? -1 : 1;
  const scale = length < 1e-12 ? 2 * sign : sign * 2 * Math.atan2(length, sign * w) / length;
  x[to] = a * scale;
  x[to + 1] = b * scale;
  x[to + 2] = c * scale;
}
