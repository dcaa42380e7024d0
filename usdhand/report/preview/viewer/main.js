// The page comes to life: data, stage, timeline, curves, controls and keys put together.

import { unpack } from 'data';
import { element, find, pressed, style } from 'dom';
import { laneEnded, laneTime, Playback, SPEEDS } from 'playback';
import { Timeline } from 'timeline';
import { Curves } from 'curves';
import { bindKeys } from 'keys';

const SHOWS = ['mesh', 'bones', 'both'];
const CAMERA_NAMES = { body: 'whole body', left: 'left hand', right: 'right hand' };

const page = JSON.parse(find('page-data').textContent);
const { lanes } = page;
const tables = await unpack(page);
const playback = new Playback(
  Math.max(...lanes.map((lane) => lane.duration)),
  Math.max(...lanes.map((lane) => lane.file_fps)),
  () => { stale = true; },
);
let stale = true;
const timeline = new Timeline(find('timeline'), playback, page.rows);
const curves = new Curves(find('curves'), lanes, tables, playback);
const stage = await openStage();

/** The 3D view; without WebGL the rest of the page still works. */
async function openStage() {
  try {
    const [{ Stage }, { Character }] = await Promise.all([import('stage'), import('character')]);
    const characters = lanes.map((lane) => new Character(lane, tables));
    return new Stage(find('view'), characters, () => { stale = true; });
  } catch (error) {
    find('trouble').hidden = false;
    document.documentElement.dataset.stage = 'none';
    find('trouble').textContent = `The 3D view cannot be shown: ${error.message}`;
    return null;
  }
}

function say(words) {
  find('status').textContent = words;
}

// Lanes: name, colour, what is odd, and whether they are shown.
const labels = lanes.map((lane, i) => {
  const label = element('div', { class: 'lane-label' });
  label.append(swatch(i), element('strong', {}, lane.name));
  label.append(element('small', {}, facts(lane)));
  find('labels').append(label);
  const box = element('input', { type: 'checkbox', id: `lane-${i}` });
  box.checked = lane.shown;
  box.addEventListener('change', () => showLanes());
  const choice = element('label', { for: `lane-${i}` });
  choice.append(box, swatch(i), lane.name);
  find('lanes').append(choice);
  return { label, box };
});
find('lane-choice').hidden = lanes.length < 2;

function swatch(i) {
  const made = element('span', { class: 'swatch', 'aria-hidden': 'true' });
  made.style.setProperty('--colour', `var(--lane-${i % 6})`);
  return made;
}

function facts(lane) {
  const retimed = Object.keys(lane.retime).length ? ', in the body’s time' : '';
  return `${lane.duration.toFixed(2)} s, ${lane.frames} frames, ${+lane.file_fps.toFixed(2)} fps${retimed}`;
}

function showLanes() {
  curves.shown = labels.map(({ box }) => box.checked);
  if (stage) stage.shown = curves.shown;
  else labels.forEach(({ label, box }) => { label.hidden = !box.checked; });
  stale = true;
  curves.draw();
  paint();
}

function placeLabels() {
  const places = stage ? stage.places() : [];
  labels.forEach(({ label }, i) => {
    const at = places.findIndex((p) => p.lane === i);
    label.hidden = at < 0;
    if (at < 0) return;
    const { x, y } = places[at];
    label.style.transform = stage.overlay
      ? `translate(8px, ${8 + 26 * at}px)` : `translate(${x + 8}px, ${y + 8}px)`;
    label.style.maxWidth = `${places[at].width - 16}px`;
  });
}

// Colours follow the style of the page; lanes that overlap are told apart by theirs.
function paint() {
  if (!stage) return;
  const parts = { body: style('--body'), left: style('--left'), right: style('--right') };
  stage.renderer.setClearColor(style('--stage'));
  stage.characters.forEach((character, i) => {
    const lane = style(`--lane-${i % 6}`);
    const colours = stage.overlay ? { body: lane, left: lane, right: lane } : parts;
    const over = stage.overlay && lanes.length > 1;
    character.paint(colours, over ? lane : '', style('--grid'), over ? i : 0);
    character.show(find('show').value);
    character.posedAt = null;
  });
  stale = true;
}

function setOverlay(on) {
  if (stage) stage.overlay = on;
  pressed(find('overlay'), on);
  say(on ? 'Lanes over each other' : 'Lanes side by side');
  paint();
}

function setCamera(mode) {
  if (mode !== 'body' && !lanes.some((lane) => lane.hands[mode])) {
    return say(`No lane has a ${mode} hand`);
  }
  stage?.setCamera(mode);
  find(`camera-${mode}`).checked = true;
  document.documentElement.dataset.camera = mode;
  if (mode !== 'body') curves.choose(mode);
  say(`Camera: ${CAMERA_NAMES[mode]}`);
}

function setTurning(on) {
  stage?.setTurning(on);
  pressed(find('turning'), on);
  say(on ? 'Close-ups turn with the wrist' : 'Close-ups keep their direction');
}

function setShow(what) {
  find('show').value = what;
  say(`Shown: ${what}`);
  paint();
}

function setSpeed(places) {
  playback.faster(places);
  find('speed').value = playback.speed;
  say(`Speed ${playback.speed}`);
}

// Controls.
find('play').addEventListener('click', () => playback.play());
find('speed').append(...SPEEDS.map((s) => element('option', { value: s }, `${s}×`)));
find('speed').value = 1;
find('speed').addEventListener('change', (e) => playback.setSpeed(Number(e.target.value)));
find('loop').addEventListener('click', () => toggleLoop());
for (const mode of Object.keys(CAMERA_NAMES)) {
  const radio = find(`camera-${mode}`);
  radio.disabled = mode !== 'body' && !lanes.some((lane) => lane.hands[mode]);
  radio.addEventListener('change', () => setCamera(mode));
}
find('overlay').addEventListener('click', () => setOverlay(!stage?.overlay));
find('overlay').hidden = lanes.length < 2;
find('turning').addEventListener('click', () => setTurning(!stage?.turning));
find('show').addEventListener('change', (e) => setShow(e.target.value));
find('show-choice').hidden = !lanes.some((lane) => lane.meshes.length);
find('reset').addEventListener('click', () => stage?.resetView());

function toggleLoop() {
  playback.loop = !playback.loop;
  pressed(find('loop'), playback.loop);
  say(playback.loop ? 'Plays again and again' : 'Stops at the end');
}

function nextShow() {
  setShow(SHOWS[(SHOWS.indexOf(find('show').value) + 1) % SHOWS.length]);
}

const turn = (yaw, pitch) => () => stage?.orbitBy(yaw, pitch);
bindKeys([
  [[' '], 'play or pause', () => playback.play()],
  [['ArrowLeft', 'ArrowRight'], 'one frame back or on', () => playback.step(-1), () => playback.step(1)],
  [['Shift+ArrowLeft', 'Shift+ArrowRight'], 'ten frames', () => playback.step(-10), () => playback.step(10)],
  [['Home', 'End'], 'first or last frame', () => playback.stopAt(0), () => playback.stopAt(playback.duration)],
  [['p', 'n'], 'previous or next border of a segment or phase, or pin', () => timeline.toBorder(-1), () => timeline.toBorder(1)],
  [['[', ']'], 'slower, faster', () => setSpeed(-1), () => setSpeed(1)],
  [['l'], 'again and again, or stop at the end', toggleLoop],
  [['1', '2', '3'], 'camera: whole body, left hand, right hand', () => setCamera('body'), () => setCamera('left'), () => setCamera('right')],
  [['t'], 'close-ups turn with the wrist', () => setTurning(!stage?.turning)],
  [['o'], 'over each other or side by side', () => setOverlay(!stage?.overlay)],
  [['m'], 'mesh, bones or both', nextShow],
  [['a', 'd'], 'orbit left, right', turn(-0.15, 0), turn(0.15, 0)],
  [['w', 's'], 'orbit up, down', turn(0, -0.1), turn(0, 0.1)],
  [['+', '-'], 'nearer, further', () => stage?.orbitBy(0, 0, 0.87), () => stage?.orbitBy(0, 0, 1.15)],
  [['0'], 'view as at first', () => stage?.resetView()],
  [['Escape'], 'leave a list, in which keys choose', () => {}],
  [['?'], 'show or hide this list', () => { find('help').open = !find('help').open; }],
], find('key-list'), () => find('keys-on').checked);

// Notes and figures.
for (const words of [...page.notes, ...lanes.flatMap((l) => l.notes.map((n) => `${l.name}: ${n}`))]) {
  find('note-list').append(element('li', {}, words));
}
find('notes').hidden = !find('note-list').children.length;
for (const { name, source } of page.figures) {
  const figure = element('figure');
  figure.append(element('img', { src: source, alt: name }), element('figcaption', {}, name));
  find('figure-list').append(figure);
}
find('figures').hidden = !page.figures.length;

/** Time code of the first lane that is shown, in words; none where that is over. */
function timeCode() {
  const lane = lanes[curves.shown.indexOf(true)];
  const side = stage?.mode;
  if (!lane || laneEnded(lane, playback.time, side)) return '';
  const frame = Math.round(laneTime(lane, playback.time, side) * lane.file_fps);
  return `, time code ${+(lane.first_time_code + frame * lane.time_codes_per_frame).toFixed(2)}`;
}

// Every frame: what has changed is drawn, nothing else.
function draw() {
  const playing = playback.playing;
  if (find('play').dataset.on !== String(playing)) {
    find('play').dataset.on = playing;
    find('play').textContent = playing ? 'Pause' : 'Play';
  }
  timeline.update(`${playback.time.toFixed(2)} s${timeCode()}`);
  curves.update();
  if (!stage) return;
  stage.characters.forEach((character, i) => {
    if (!stage.shown[i]) return;
    const time = laneTime(lanes[i], playback.time, stage.mode);
    if (character.posedAt === time) return;
    character.pose(time);
    character.posedAt = time;
  });
  stage.render();
  placeLabels();
}

// While playing, what takes longer than LATE to draw gets fewer pixels; standing still, all again.
const LATE = 45; // milliseconds a frame
const DETAILS = [1, 0.7, 0.5];
let before = 0;
let late = 0;

function keepUp(now) {
  const passed = now - before;
  before = now;
  late = playback.playing ? Math.max(late + (passed > LATE ? 1 : -0.25), 0) : 0;
  const at = DETAILS.indexOf(stage.detail);
  if (!playback.playing) stage.setDetail(1);
  else if (late > 8 && at < DETAILS.length - 1) {
    stage.setDetail(DETAILS[at + 1]);
    late = 0;
  }
}

function loop(now) {
  playback.tick(now);
  if (stage) keepUp(now);
  if (stale) {
    stale = false;
    draw();
  }
  requestAnimationFrame(loop);
}

matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
  paint();
  curves.draw();
});
setCamera('body');
say('');
showLanes();
draw();
document.documentElement.dataset.ready = performance.now().toFixed(0);
requestAnimationFrame(loop);
