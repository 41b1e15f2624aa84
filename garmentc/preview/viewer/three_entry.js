// What the viewer takes of three.js; three.LICENSE.md says how three.bundle.js is made of it.

export {
  ACESFilmicToneMapping, AnimationMixer, Box3, BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide, Euler,
  HemisphereLight, Matrix4, Mesh, MeshBasicMaterial, MeshStandardMaterial, NeutralToneMapping, PCFShadowMap,
  PerspectiveCamera, PlaneGeometry, PMREMGenerator, Quaternion, REVISION, Scene, ShadowMaterial, Skeleton, SkeletonHelper,
  SkinnedMesh, SRGBColorSpace, Vector3, VSMShadowMap, WebGLRenderer,
} from 'three';
export {OrbitControls} from 'three/examples/jsm/controls/OrbitControls.js';
export {RoomEnvironment} from 'three/examples/jsm/environments/RoomEnvironment.js';
export {MeshoptDecoder} from 'three/examples/jsm/libs/meshopt_decoder.module.js';
export {GLTFLoader} from 'three/examples/jsm/loaders/GLTFLoader.js';
