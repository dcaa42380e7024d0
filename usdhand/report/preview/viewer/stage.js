// What is seen: every lane in a part of one canvas, or all over each other, from cameras that move
// together. The cameras' orbit is around the point (0, 0, 0) in units of what is looked at; each
// lane puts it around its own body or hand.

import * as THREE from 'three';
import { OrbitControls } from 'orbit';

const FIELD_OF_VIEW = 32;
const FIRST_VIEW = { body: [0.45, 0.22, 2.15], left: [0.5, 0.5, 2.0], right: [-0.5, 0.5, 2.0] };

export class Stage {
  constructor(canvas, characters, changed) {
    this.canvas = canvas;
    this.characters = characters;
    this.changed = changed;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !drawnBySoftware() });
    this.detail = 1;
    this.renderer.autoClear = false;
    this.renderer.setScissorTest(true);
    this.orbitCamera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.01, 100);
    this.orbit = new OrbitControls(this.orbitCamera, canvas);
    this.orbit.addEventListener('change', changed);
    this.orbit.minDistance = 0.2;
    this.orbit.maxDistance = 20;
    this.cameras = characters.map(() => new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1));
    this.views = {};
    this.shown = characters.map((c) => c.lane.shown);
    this.mode = 'body';
    this.overlay = false;
    this.turning = false;
    this.resetView();
    new ResizeObserver(changed).observe(canvas);
  }

  /** Looks at "body", "left" or "right"; every one of them keeps its own orbit. */
  setCamera(mode) {
    this.#look(mode, this.turning);
  }

  /** Close-up cameras turn with the wrist: the hand stands still, its fingers move. */
  setTurning(on) {
    this.#look(this.mode, on);
  }

  resetView() {
    const start = this.turning && this.mode !== 'body' ? [0, 0, 2.2] : FIRST_VIEW[this.mode];
    this.#moveOrbit(new THREE.Vector3(...start), new THREE.Vector3());
  }

  #look(mode, turning) {
    const name = () => (this.turning && this.mode !== 'body' ? `${this.mode} turning` : this.mode);
    this.views[name()] = [this.orbitCamera.position.clone(), this.orbit.target.clone()];
    this.mode = mode;
    this.turning = turning;
    const view = this.views[name()];
    if (view) this.#moveOrbit(...view);
    else this.resetView();
  }

  #moveOrbit(position, target) {
    this.orbitCamera.position.copy(position);
    this.orbit.target.copy(target);
    this.orbit.update();
    this.changed();
  }

  /** Turns the orbit by radians and moves it nearer (below 1) or away. */
  orbitBy(yaw, pitch, away = 1) {
    const offset = this.orbitCamera.position.clone().sub(this.orbit.target);
    const sphere = new THREE.Spherical().setFromVector3(offset);
    sphere.theta += yaw;
    sphere.phi += pitch;
    sphere.radius *= away;
    sphere.makeSafe();
    this.orbitCamera.position.setFromSpherical(sphere).add(this.orbit.target);
    this.orbit.update();
    this.changed();
  }

  /** Fewer pixels (below 1) for machines that could not keep up with the motion. */
  setDetail(detail) {
    if (this.detail === detail) return;
    this.detail = detail;
    this.changed();
  }

  /** Lanes that are seen with their places {x, y, width, height}, in pixels from the top left. */
  places() {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const lanes = this.characters.map((_, i) => i).filter((i) => this.shown[i]);
    if (this.overlay) return lanes.map((lane) => ({ lane, x: 0, y: 0, width, height }));
    const columns = columnsFor(lanes.length, width / height);
    const rows = Math.ceil(lanes.length / columns);
    return lanes.map((lane, i) => ({
      lane,
      x: ((i % columns) * width) / columns,
      y: (Math.floor(i / columns) * height) / rows,
      width: width / columns,
      height: height / rows,
    }));
  }

  render() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.#fit(width, height);
    this.renderer.setScissor(0, 0, width, height);
    this.renderer.clear();
    this.places().forEach(({ lane, x, y, ...size }, i) => {
      const character = this.characters[lane];
      const box = [x, height - y - size.height, size.width, size.height];
      this.renderer.setViewport(...box);
      this.renderer.setScissor(...box);
      character.ground.visible = i === 0 || !this.overlay;
      this.#place(this.cameras[lane], character, size.width / size.height);
      this.renderer.render(character.scene, this.cameras[lane]);
    });
  }

  #fit(width, height) {
    const ratio = Math.min(window.devicePixelRatio, 2) * this.detail;
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height || this.renderer.getPixelRatio() !== ratio) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
    }
  }

  /** Puts a lane's camera where the orbit is, around the lane's own body or hand. */
  #place(camera, character, aspect) {
    const { target, size, turn } = this.#lookAt(character);
    const away = size * Math.max(1, 0.8 / aspect);
    camera.position.copy(this.orbitCamera.position).multiplyScalar(away);
    camera.position.applyQuaternion(turn).add(target);
    camera.quaternion.copy(turn).multiply(this.orbitCamera.quaternion);
    camera.aspect = aspect;
    // What stands between a close-up camera and the hand is cut away.
    const near = this.mode === 'body' ? 0 : camera.position.distanceTo(target) - 0.9 * size;
    camera.near = Math.max(near, 0.01 * size);
    camera.far = 60 * size;
    camera.updateProjectionMatrix();
  }

  /** What a lane's camera looks at, its size, and how the orbit is turned around it. */
  #lookAt(character) {
    const first = this.overlay ? this.characters[this.places()[0].lane] : character;
    const { lane, world } = character;
    const up = new THREE.Vector3(0, 1, 0);
    const turn = new THREE.Quaternion().setFromAxisAngle(up, first.lane.view.yaw);
    const hand = lane.hands[this.mode];
    if (!hand) {
      const { centre, size } = first.lane.view;
      const target = new THREE.Vector3(...centre);
      if (lane.view.follow !== null) {
        const joint = new THREE.Vector3().setFromMatrixPosition(world[lane.view.follow]);
        target.set(joint.x, target.y, joint.z);
      }
      return { target, size, turn };
    }
    // Over each other, all look as far ahead of the wrist as the first: wrists are in one place.
    const palm = palmOf(character, hand);
    const firstHand = first.lane.hands[this.mode];
    const ahead = firstHand && !this.turning ? palmOf(first, firstHand) : palm;
    const target = new THREE.Vector3(0, 0, 0.45 * hand.size).applyQuaternion(ahead);
    target.add(new THREE.Vector3().setFromMatrixPosition(world[hand.wrist]));
    return { target, size: hand.size, turn: this.turning ? palm.multiply(FINGERS_UP) : turn };
  }
}

/** How a palm is turned in the world. */
function palmOf({ world }, hand) {
  const wrist = new THREE.Quaternion().setFromRotationMatrix(world[hand.wrist]);
  return wrist.multiply(new THREE.Quaternion(...hand.palm));
}

// Axes of the palm are abduction, flexion and length; seen from its back with the fingers up.
const FINGERS_UP = new THREE.Quaternion().setFromRotationMatrix(
  new THREE.Matrix4().makeBasis(
    new THREE.Vector3(0, -1, 0), new THREE.Vector3(0, 0, 1), new THREE.Vector3(-1, 0, 0)),
);

/** Whether there is no graphics processor: smoothing edges would then cost half of the frames. */
function drawnBySoftware() {
  const context = document.createElement('canvas').getContext('webgl2');
  const names = context?.getExtension('WEBGL_debug_renderer_info');
  const name = names ? context.getParameter(names.UNMASKED_RENDERER_WEBGL) : '';
  context?.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/** Columns that leave every lane the largest square. */
function columnsFor(lanes, aspect) {
  const square = (n) => Math.min(aspect / n, 1 / Math.ceil(lanes / n));
  let best = 1;
  for (let n = 2; n <= lanes; n++) if (square(n) > square(best)) best = n;
  return best;
}
