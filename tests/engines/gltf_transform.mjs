// World positions of every vertex at the given times of the first animation. glTF-Transform reads the file (sparse and
// quantized accessors, the scene); morphing and skinning are done here, from the formulas of the glTF specification.

import {NodeIO} from '@gltf-transform/core';
import {ALL_EXTENSIONS} from '@gltf-transform/extensions';
import {MeshoptDecoder} from 'meshoptimizer';
import {eachJob, writePositions} from './jobs.mjs';

await MeshoptDecoder.ready;
const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({'meshopt.decoder': MeshoptDecoder});

/** All elements of an accessor as plain numbers, normalised integers as fractions. */
function numbers(accessor) {
  const element = [], all = [];
  for (let i = 0; i < accessor.getCount(); i++) all.push(...accessor.getElement(i, element));
  return all;
}

/** a * b of column-major 4 x 4 matrices. */
function multiply(a, b) {
  const product = new Array(16).fill(0);
  for (let column = 0; column < 4; column++)
    for (let row = 0; row < 4; row++)
      for (let k = 0; k < 4; k++) product[4 * column + row] += a[4 * k + row] * b[4 * column + k];
  return product;
}

function compose([tx, ty, tz], [x, y, z, w], [sx, sy, sz]) {
  return [
    (1 - 2 * (y * y + z * z)) * sx, 2 * (x * y + z * w) * sx, 2 * (x * z - y * w) * sx, 0,
    2 * (x * y - z * w) * sy, (1 - 2 * (x * x + z * z)) * sy, 2 * (y * z + x * w) * sy, 0,
    2 * (x * z + y * w) * sz, 2 * (y * z - x * w) * sz, (1 - 2 * (x * x + y * y)) * sz, 0,
    tx, ty, tz, 1,
  ];
}

function slerp(a, b, amount) {
  let cosine = a.reduce((sum, value, i) => sum + value * b[i], 0);
  if (cosine < 0) [b, cosine] = [b.map(value => -value), -cosine];
  const angle = Math.acos(Math.min(1, cosine));
  if (angle < 1e-6) return a;
  return a.map((value, i) => (Math.sin((1 - amount) * angle) * value + Math.sin(amount * angle) * b[i]) / Math.sin(angle));
}

function sample({times, values, width, rotation}, time) {
  const at = index => values.slice(index * width, (index + 1) * width);
  const after = times.findIndex(key => key > time);
  if (after === 0) return at(0);
  if (after < 0) return at(times.length - 1);
  const amount = (time - times[after - 1]) / (times[after] - times[after - 1]);
  const [a, b] = [at(after - 1), at(after)];
  return rotation ? slerp(a, b, amount) : a.map((value, i) => value + amount * (b[i] - value));
}

function channelsOf(animation) {
  return animation.listChannels().map(channel => {
    const sampler = channel.getSampler(), path = channel.getTargetPath();
    if (sampler.getInterpolation() !== 'LINEAR') throw new Error('only LINEAR is expected here');
    const times = numbers(sampler.getInput()), values = numbers(sampler.getOutput());
    return {node: channel.getTargetNode(), path, times, values, width: values.length / times.length, rotation: path === 'rotation'};
  });
}

function readPrimitive(primitive) {
  const sets = [];
  for (let set = 0; primitive.getAttribute(`JOINTS_${set}`); set++)
    sets.push({joints: numbers(primitive.getAttribute(`JOINTS_${set}`)), weights: numbers(primitive.getAttribute(`WEIGHTS_${set}`))});
  const targets = primitive.listTargets().map(target => numbers(target.getAttribute('POSITION')));
  return {positions: numbers(primitive.getAttribute('POSITION')), targets, sets};
}

function skinned({positions, targets, sets}, morphWeights, matrices) {
  const vertices = positions.slice();
  targets.forEach((deltas, target) => {
    const weight = morphWeights[target];
    if (weight) deltas.forEach((delta, i) => { vertices[i] += weight * delta; });
  });
  const result = new Array(vertices.length).fill(0);
  for (let vertex = 0; vertex < vertices.length / 3; vertex++) {
    const [x, y, z] = vertices.slice(3 * vertex, 3 * vertex + 3);
    for (const {joints, weights} of sets)
      for (let slot = 4 * vertex; slot < 4 * vertex + 4; slot++) {
        const matrix = matrices[joints[slot]];
        for (let row = 0; row < 3; row++)
          result[3 * vertex + row] += weights[slot] * (matrix[row] * x + matrix[4 + row] * y + matrix[8 + row] * z + matrix[12 + row]);
      }
  }
  return result;
}

await eachJob(async ({glb, out, times}) => {
  const root = (await io.read(glb)).getRoot();
  const animation = root.listAnimations()[0];
  const channels = animation ? channelsOf(animation) : [];
  const meshes = root.listNodes().filter(node => node.getMesh()).map(node => ({
    node,
    joints: node.getSkin().listJoints(),
    inverseBind: numbers(node.getSkin().getInverseBindMatrices()),
    primitives: node.getMesh().listPrimitives().map(readPrimitive),
  }));
  const positions = [];
  for (const time of times) {
    const animated = new Map();
    for (const channel of channels) {
      if (!animated.has(channel.node)) animated.set(channel.node, {});
      animated.get(channel.node)[channel.path] = sample(channel, time);
    }
    const world = node => {
      const {translation, rotation, scale} = animated.get(node) ?? {};
      const local = compose(translation ?? node.getTranslation(), rotation ?? node.getRotation(), scale ?? node.getScale());
      return node.getParentNode() ? multiply(world(node.getParentNode()), local) : local;
    };
    for (const {node, joints, inverseBind, primitives} of meshes) {
      const matrices = joints.map((joint, i) => multiply(world(joint), inverseBind.slice(16 * i, 16 * i + 16)));
      const weights = animated.get(node)?.weights ?? node.getMesh().getWeights();
      for (const primitive of primitives) for (const value of skinned(primitive, weights, matrices)) positions.push(value);
    }
  }
  writePositions(out, positions);
});
