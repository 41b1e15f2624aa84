// World positions of every vertex at the given times of the first animation, by Babylon.js without a browser or a GPU.
// Babylon reads two sets of joints and weights, on the CPU as in its shaders.

import fs from 'node:fs';
import {eachJob, writePositions} from './jobs.mjs';

globalThis.self = globalThis; // Babylon's loader asks for it
const {NullEngine} = await import('@babylonjs/core/Engines/nullEngine.js');
const {Scene} = await import('@babylonjs/core/scene.js');
const {Vector3} = await import('@babylonjs/core/Maths/math.vector.js');
const {FreeCamera} = await import('@babylonjs/core/Cameras/freeCamera.js');
const {ImportMeshAsync} = await import('@babylonjs/core/Loading/sceneLoader.js');
const {Logger} = await import('@babylonjs/core/Misc/logger.js');
const {MeshoptCompression} = await import('@babylonjs/core/Meshes/Compression/meshoptCompression.js');
const {MeshoptDecoder} = await import('meshoptimizer');
await import('@babylonjs/core/Animations/animatable.js');
await import('@babylonjs/core/Bones/skeleton.js');
await import('@babylonjs/loaders/glTF/2.0/index.js');

Logger.LogLevels = Logger.ErrorLogLevel;
await MeshoptDecoder.ready;
// Babylon would fetch its decoder from its makers' server.
MeshoptCompression._Default = {
  async decodeGltfBufferAsync(source, count, stride, mode, filter) {
    const decoded = new Uint8Array(count * stride);
    MeshoptDecoder.decodeGltfBuffer(decoded, count, stride, source, mode, filter);
    return decoded;
  },
  dispose() {},
};
const FRAMES_PER_SECOND = 60; // the loader's own clock

const engine = new NullEngine();
await eachJob(async ({glb, out, times}) => {
  const scene = new Scene(engine);
  scene.useRightHandedSystem = true;
  new FreeCamera('camera', new Vector3(0, 1, 5), scene);
  const loaded = await ImportMeshAsync(new Uint8Array(fs.readFileSync(glb)), scene, {pluginExtension: '.glb', name: 'a.glb'});
  const meshes = loaded.meshes.filter(mesh => mesh.getTotalVertices() > 0);
  const [animation] = loaded.animationGroups;
  animation?.start(true);
  animation?.pause();
  const positions = [], vertex = new Vector3();
  for (const time of times) {
    animation?.goToFrame(time * FRAMES_PER_SECOND);
    scene.render();
    for (const mesh of meshes) {
      mesh.skeleton.prepare(true);
      mesh.computeWorldMatrix(true);
      const moved = mesh.getPositionData(true, true);
      for (let i = 0; i < moved.length; i += 3) {
        Vector3.TransformCoordinatesFromFloatsToRef(moved[i], moved[i + 1], moved[i + 2], mesh.getWorldMatrix(), vertex);
        positions.push(vertex.x, vertex.y, vertex.z);
      }
    }
  }
  scene.dispose();
  writePositions(out, positions);
});
process.exit(0); // Babylon's timers would keep it alive
