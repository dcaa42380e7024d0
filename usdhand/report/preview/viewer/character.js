// A lane's character: its pose at a time, bones with thickness, and meshes that follow them.

import * as THREE from 'three';

const UP = new THREE.Vector3(0, 1, 0);
const THIN = 0.75; // radius of a bone's end, of that of its start
const matrix = new THREE.Matrix4();
const quaternion = new Float32Array(4);
const moved = new Float32Array(3);
const scaled = new Float32Array(3);

export class Character {
  constructor(lane, tables) {
    this.lane = lane;
    this.count = lane.parents.length;
    this.rotations = lane.rotations.map((i) => tables[i]);
    this.translations = lane.translations.map((i) => tables[i]);
    this.scales = lane.parents.map((_, j) => (j in lane.scales ? tables[lane.scales[j]] : null));
    this.world = lane.parents.map(() => new THREE.Matrix4());
    this.scene = new THREE.Scene();
    this.scene.add(...lights());
    this.bones = new THREE.Group();
    this.skin = new THREE.Group();
    this.scene.add(this.bones, this.skin);
    this.#makeBones();
    this.#makeMeshes(tables);
    this.#makeGround();
    this.pose(0);
  }

  get hasMesh() {
    return this.lane.meshes.length > 0;
  }

  /** Poses the character as it is `time` seconds after its first frame. */
  pose(time) {
    const frame = time * this.lane.fps;
    for (const j of this.lane.order) {
      this.rotations[j].at(frame, quaternion);
      this.translations[j].at(frame, moved);
      const scales = this.scales[j] ? this.scales[j].at(frame, scaled) : null;
      compose(this.world[j], quaternion, moved, scales);
      const parent = this.lane.parents[j];
      if (parent >= 0) this.world[j].premultiply(this.world[parent]);
    }
    if (this.bones.visible) this.#placeBones();
    if (this.skin.visible) this.#placeMeshes();
  }

  /** Shows "bones", "mesh" or "both"; a character without mesh always has bones. */
  show(what) {
    const mesh = this.hasMesh && what !== 'bones';
    this.bones.visible = !mesh || what === 'both';
    this.skin.visible = mesh;
    for (const { material, depth } of this.surfaces) {
      material.opacity = what === 'both' ? 0.4 : 1;
      material.transparent = material.opacity < 1;
      material.needsUpdate = true;
      depth.visible = material.transparent;
    }
  }

  /**
   * Colours of body, left and right hand; `tint` colours the mesh too, for lanes that overlap. Where
   * they are in one place, that of the lowest `layer` is seen.
   */
  paint(colours, tint, ground, layer) {
    const colour = new THREE.Color();
    this.lane.bones.forEach(({ part }, i) => this.sticks.setColorAt(i, colour.set(colours[part])));
    this.balls.forEach(({ part }, i) => this.knobs.setColorAt(i, colour.set(colours[part])));
    for (const mesh of [this.sticks, this.knobs]) {
      if (mesh.instanceColor) mesh.instanceColor.needsUpdate = true;
    }
    for (const { material, own } of this.surfaces) material.color.copy(tint ? colour.set(tint) : own);
    const materials = [this.sticks, this.knobs, ...this.surfaces].map((each) => each.material);
    for (const material of materials) {
      material.polygonOffset = layer > 0;
      material.polygonOffsetFactor = layer;
      material.polygonOffsetUnits = 4 * layer;
    }
    this.ground.material.color.set(ground);
  }

  #makeBones() {
    const bones = this.lane.bones;
    const stick = new THREE.CylinderGeometry(THIN, 1, 1, 12, 1, true).translate(0, 0.5, 0);
    const knob = new THREE.SphereGeometry(1, 12, 8);
    const starts = new Map();
    for (const { joint, radius } of bones) {
      starts.set(joint, Math.max(starts.get(joint) ?? 0, radius));
    }
    const turn = ({ to }) =>
      new THREE.Quaternion().setFromUnitVectors(UP, new THREE.Vector3(...to).normalize());
    const shape = (bone, at, [x, y, z]) =>
      new THREE.Matrix4().compose(new THREE.Vector3(...at), turn(bone), new THREE.Vector3(x, y, z));
    const ball = (bone, at, r, joint = bone.joint) =>
      ({ joint, part: bone.part, shape: shape(bone, at, [r, r, r]) });
    this.shapes = bones.map((bone) =>
      shape(bone, [0, 0, 0], [bone.radius, Math.hypot(...bone.to), bone.radius]));
    // A ball where a bone begins, and one where it ends if no larger one begins there.
    this.balls = bones.flatMap((bone) => {
      const next = bone.child === bone.joint ? 0 : (starts.get(bone.child) ?? 0);
      const ends = next < THIN * bone.radius;
      const start = ball(bone, [0, 0, 0], bone.radius);
      const end = bone.loose ? [[0, 0, 0], THIN * bone.radius, bone.child] : [bone.to, THIN * bone.radius];
      return ends ? [start, ball(bone, ...end)] : [start];
    });
    const material = () => new THREE.MeshLambertMaterial();
    this.sticks = new THREE.InstancedMesh(stick, material(), bones.length);
    this.knobs = new THREE.InstancedMesh(knob, material(), this.balls.length);
    for (const mesh of [this.sticks, this.knobs]) {
      mesh.frustumCulled = false;
      this.bones.add(mesh);
    }
  }

  #placeBones() {
    this.lane.bones.forEach((bone, i) => {
      if (bone.loose) stretched(matrix, this.world[bone.joint], this.world[bone.child], bone.radius);
      else matrix.multiplyMatrices(this.world[bone.joint], this.shapes[i]);
      this.sticks.setMatrixAt(i, matrix);
    });
    this.balls.forEach(({ joint, shape }, i) =>
      this.knobs.setMatrixAt(i, matrix.multiplyMatrices(this.world[joint], shape)));
    this.sticks.instanceMatrix.needsUpdate = true;
    this.knobs.instanceMatrix.needsUpdate = true;
  }

  #makeMeshes(tables) {
    this.surfaces = [];
    this.meshJoints = this.world.map(() => new THREE.Bone());
    for (const mesh of this.lane.meshes) {
      const geometry = shared(mesh, tables);
      const own = new THREE.Color(...mesh.colour);
      const material = new THREE.MeshLambertMaterial({ color: own, side: THREE.DoubleSide });
      // Where a mesh is see-through, only what is nearest to the camera is drawn.
      const first = new THREE.MeshBasicMaterial({ colorWrite: false, side: THREE.DoubleSide });
      const inverses = this.world.map((_, j) =>
        new THREE.Matrix4().fromArray(mesh.inverse_bind, 16 * j));
      const skeleton = new THREE.Skeleton(this.meshJoints, inverses);
      const [surface, depth] = [material, first].map((m) => skinned(geometry, m, skeleton));
      depth.renderOrder = 1;
      surface.renderOrder = 2;
      this.skin.add(depth, surface);
      this.surfaces.push({ material, depth, own });
    }
  }

  #placeMeshes() {
    this.meshJoints.forEach((joint, j) => joint.matrixWorld.copy(this.world[j]));
  }

  #makeGround() {
    const { centre, size, floor } = this.lane.view;
    this.ground = new THREE.GridHelper(3 * size, 12);
    this.ground.material.vertexColors = false;
    this.ground.material.needsUpdate = true;
    this.ground.position.set(centre[0], floor, centre[2]);
    this.scene.add(this.ground);
  }
}

const geometries = new Map();

/** Points and faces of a mesh: one for all lanes that have the same. */
function shared(mesh, tables) {
  const key = [mesh.points, mesh.joints, mesh.weights, mesh.triangles].join();
  if (geometries.has(key)) return geometries.get(key);
  const geometry = new THREE.BufferGeometry();
  const attribute = (table, normalized) =>
    new THREE.BufferAttribute(table.values, table.columns, normalized);
  geometry.setAttribute('position', attribute(tables[mesh.points]));
  geometry.setAttribute('skinIndex', attribute(tables[mesh.joints]));
  geometry.setAttribute('skinWeight', attribute(tables[mesh.weights], true));
  geometry.setIndex(new THREE.BufferAttribute(tables[mesh.triangles].values, 1));
  geometry.computeVertexNormals();
  geometries.set(key, geometry);
  return geometry;
}

function skinned(geometry, material, skeleton) {
  const mesh = new THREE.SkinnedMesh(geometry, material);
  mesh.frustumCulled = false;
  mesh.bind(skeleton, new THREE.Matrix4());
  return mesh;
}

function lights() {
  const sun = new THREE.DirectionalLight(0xffffff, 2.2);
  sun.position.set(0.5, 1, 0.8);
  const back = new THREE.DirectionalLight(0xffffff, 0.8);
  back.position.set(-0.6, 0.4, -1);
  return [new THREE.HemisphereLight(0xffffff, 0x777788, 1.6), sun, back];
}

/** The matrix of a stick from one joint to another that does not hang off it. */
function stretched(out, from, to, radius) {
  const start = new THREE.Vector3().setFromMatrixPosition(from);
  const along = new THREE.Vector3().setFromMatrixPosition(to).sub(start);
  const length = along.length();
  const turn = new THREE.Quaternion().setFromUnitVectors(UP, along.normalize());
  out.compose(start, turn, new THREE.Vector3(radius, length, radius));
}

/** The matrix of a rotation that need not be of unit length, a translation and scales. */
function compose(out, [x, y, z, w], [tx, ty, tz], scales) {
  const s = 2 / (x * x + y * y + z * z + w * w);
  const [sx, sy, sz] = scales ?? [1, 1, 1];
  const e = out.elements;
  e[0] = (1 - s * (y * y + z * z)) * sx;
  e[1] = s * (x * y + z * w) * sx;
  e[2] = s * (x * z - y * w) * sx;
  e[4] = s * (x * y - z * w) * sy;
  e[5] = (1 - s * (x * x + z * z)) * sy;
  e[6] = s * (y * z + x * w) * sy;
  e[8] = s * (x * z + y * w) * sz;
  e[9] = s * (y * z - x * w) * sz;
  e[10] = (1 - s * (x * x + y * y)) * sz;
  e[12] = tx;
  e[13] = ty;
  e[14] = tz;
}
