// The body under the outfit: SMPL's formula on the outfit's own joints.

import {BufferAttribute, BufferGeometry, Matrix4, MeshStandardMaterial, Skeleton, SkinnedMesh} from 'three';

const bytes = base64 => Uint8Array.from(atob(base64), character => character.charCodeAt(0)).buffer;

/** A body as garmentc/preview/page.py writes it, skinned to `bones`: 24 joints in SMPL's order. */
export class Body {
  constructor({vertices, faces, joints, weights, places, corrected, counts, directions, step}, bones) {
    this.bones = bones;
    this.rest = new Float32Array(bytes(vertices));
    this.corrected = new Uint16Array(bytes(corrected));
    this.counts = counts;
    this.directions = new Int16Array(bytes(directions));
    this.step = step;
    this.rotation = new Matrix4();
    this.pose = new Float64Array(4 * bones.length);

    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(this.rest.slice(), 3));
    geometry.setAttribute('skinIndex', new BufferAttribute(new Uint8Array(bytes(joints)), 4));
    geometry.setAttribute('skinWeight', new BufferAttribute(new Float32Array(bytes(weights)), 4));
    geometry.setIndex(new BufferAttribute(new Uint32Array(bytes(faces)), 1));
    geometry.computeVertexNormals();
    const material = new MeshStandardMaterial({color: 0xb3a79c, roughness: 0.75, metalness: 0});
    this.mesh = new SkinnedMesh(geometry, material);
    // The joints' places in the body's axes: whatever places the whole figure is above the pelvis and moves the body too.
    const inverses = places.map(([x, y, z]) => new Matrix4().makeTranslation(-x, -y, -z));
    this.mesh.bind(new Skeleton(bones, inverses), new Matrix4());
    this.mesh.frustumCulled = false;
    this.mesh.castShadow = this.mesh.receiveShadow = true;
  }

  /** Add the pose correctives of the joints as they are now (Loper et al. 2015, equation 9). */
  update() {
    if (!this.moved()) return;
    const {position} = this.mesh.geometry.attributes, vertices = position.array, {corrected, directions, step} = this;
    vertices.set(this.rest);
    for (let joint = 1, at = 0; joint < this.bones.length; joint++) {
      const e = this.rotation.makeRotationFromQuaternion(this.bones[joint].quaternion).elements;
      const feature = [e[0] - 1, e[4], e[8], e[1], e[5] - 1, e[9], e[2], e[6], e[10] - 1]; // row by row
      for (const end = at + this.counts[joint - 1]; at < end; at++)
        for (let axis = 0; axis < 3; axis++) {
          let offset = 0;
          for (let entry = 0; entry < 9; entry++) offset += feature[entry] * directions[27 * at + 9 * axis + entry];
          vertices[3 * corrected[at] + axis] += offset * step;
        }
    }
    position.needsUpdate = true;
  }

  /** Whether a joint turned since the last call. */
  moved() {
    let moved = false;
    this.bones.forEach(({quaternion}, joint) => {
      for (const [part, value] of [quaternion.x, quaternion.y, quaternion.z, quaternion.w].entries()) {
        moved ||= this.pose[4 * joint + part] !== value;
        this.pose[4 * joint + part] = value;
      }
    });
    return moved;
  }
}
