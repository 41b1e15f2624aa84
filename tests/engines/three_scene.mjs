// A .glb in three.js, without a browser or a GPU: its loader, scene graph and skinning run on the CPU.

import fs from 'node:fs';

globalThis.self = globalThis; // three's loader asks for it
globalThis.createImageBitmap = async () => ({width: 1, height: 1, close() {}}); // textures are not looked at
const THREE = await import('three');
const {GLTFLoader} = await import('three/examples/jsm/loaders/GLTFLoader.js');
const {MeshoptDecoder} = await import('three/examples/jsm/libs/meshopt_decoder.module.js');

/** The loaded scene, its animations, and its skinned meshes: one for each primitive, in the file's order. */
export async function load(path) {
  const bytes = fs.readFileSync(path);
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  const {scene, animations} = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).parseAsync(buffer, '');
  const meshes = [];
  scene.traverse(object => { if (object.isSkinnedMesh) meshes.push(object); });
  return {scene, animations, meshes};
}

/** World positions of all vertices, as three's own raycasting computes them. */
export function worldPositions(scene, meshes) {
  scene.updateMatrixWorld(true);
  const positions = [], vertex = new THREE.Vector3();
  for (const mesh of meshes) {
    mesh.skeleton.update();
    for (let i = 0; i < mesh.geometry.attributes.position.count; i++)
      positions.push(...mesh.getVertexPosition(i, vertex).applyMatrix4(mesh.matrixWorld).toArray());
  }
  return positions;
}

export {THREE};
