// Curves of the channels of one digit, a row a channel, a line a lane.

import { element, find, style } from 'dom';
import { laneEnded, laneTime } from 'playback';

const DIGITS = ['Thumb', 'Index', 'Middle', 'Ring', 'Pinky'];
const AXES = { x: 'abduction', y: 'flexion', z: 'twist' };
const THUMB_AXES = { x: 'abduction', z: 'flexion', y: 'twist' };
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3]];
const LEAST_RANGE = 10; // degrees: what hardly moves looks so

export class Curves {
  constructor(root, lanes, tables, playback) {
    this.root = root;
    this.lanes = lanes;
    this.tables = tables;
    this.playback = playback;
    this.shown = lanes.map((lane) => lane.shown);
    this.rows = [];
    const sides = ['left', 'right'].filter((s) => lanes.some((lane) => lane.hands[s]));
    root.hidden = sides.length === 0;
    if (root.hidden) return;
    this.hand = find('hand');
    this.digit = find('digit');
    this.hand.append(...sides.map((s) => element('option', { value: s }, `${s} hand`)));
    this.hand.value = sides.includes('right') ? 'right' : sides[0];
    this.digit.append(...DIGITS.map((d) => element('option', { value: d }, d.toLowerCase())));
    this.digit.value = 'Index';
    for (const select of [this.hand, this.digit]) {
      select.addEventListener('change', () => this.build());
    }
    new ResizeObserver(() => this.draw()).observe(root);
    this.build();
  }

  choose(side) {
    if (!this.hand || ![...this.hand.options].some((o) => o.value === side)) return;
    this.hand.value = side;
    this.build();
  }

  /** Makes the rows for the hand and digit that are chosen. */
  build() {
    const side = this.hand.value;
    const names = this.lanes.flatMap((lane) => Object.keys(lane.hands[side]?.channels ?? {}));
    const chosen = [...new Set(names)].filter((n) => n.slice(2).startsWith(this.digit.value));
    this.rows = chosen.map((name) => this.#row(name, side));
    find('curve-rows').replaceChildren(...this.rows.flatMap((row) => row.cells));
    this.draw();
  }

  #row(name, side) {
    const [, digit, joint, axis] = name.match(/^..(Thumb|Index|Middle|Ring|Pinky)(.+)(.)$/);
    const words = `${joint} ${(digit === 'Thumb' ? THUMB_AXES : AXES)[axis]}`;
    const label = element('span', { class: `label ${side}` }, words);
    label.append(element('small', {}, name));
    const canvas = element('canvas', { class: 'track curve', role: 'img' });
    const values = this.lanes.map((lane, i) => {
      const value = element('span', { class: 'number' });
      value.style.color = `var(--lane-${i % 6})`;
      value.title = [lane.name, lane.relations[name]].filter(Boolean).join(': ');
      return value;
    });
    const box = element('span', { class: 'value' });
    box.append(...values);
    const relation = this.lanes.map((lane) => lane.relations[name]).find(Boolean);
    if (relation) box.append(element('small', {}, relation));
    const tables = this.lanes.map((lane) => this.tables[lane.hands[side]?.channels[name]]);
    return { name, words, side, canvas, values, tables, cells: [label, canvas, box] };
  }

  draw() {
    for (const row of this.rows) this.#drawRow(row);
    this.update();
  }

  #drawRow({ canvas, tables, side, words }) {
    const ratio = Math.min(window.devicePixelRatio, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const lines = this.lanes.flatMap((lane, i) =>
      this.shown[i] && tables[i] ? [{ i, points: this.#sampled(lane, tables[i], side, width) }] : []);
    const all = lines.flatMap(({ points }) => points.filter((v) => v !== null));
    if (!all.length) return;
    const middle = (Math.min(...all) + Math.max(...all)) / 2;
    const range = Math.max(Math.max(...all) - Math.min(...all), LEAST_RANGE);
    const y = (v) => height * (0.5 - (0.86 * (v - middle)) / range);
    const ink = canvas.getContext('2d');
    ink.scale(ratio, ratio);
    for (const { i, points } of lines) {
      ink.beginPath();
      ink.strokeStyle = style(`--lane-${i % 6}`);
      ink.lineWidth = 1.5;
      ink.setLineDash(DASHES[i % DASHES.length]);
      points.forEach((v, x) => v !== null && ink.lineTo(x / 2, y(v)));
      ink.stroke();
    }
    ink.fillStyle = style('--muted');
    ink.font = '10px system-ui, sans-serif';
    const [top, low] = [middle + range / 2, middle - range / 2];
    ink.fillText(`${top.toFixed(0)}°`, 3, 10);
    ink.fillText(`${low.toFixed(0)}°`, 3, height - 3);
    canvas.setAttribute('aria-label', `${words}: ${low.toFixed(0)} to ${top.toFixed(0)} degrees`);
  }

  /** Two numbers a pixel: the least and the most there, in the order that they come in. */
  #sampled(lane, table, side, width) {
    const points = [];
    const frame = (x) =>
      laneTime(lane, (x / width) * this.playback.duration, side) * lane.fps;
    for (let x = 0; x < width; x++) {
      const [from, to] = [frame(x), frame(x + 1)];
      if (from > table.rows && !lane.retime[side] && table.rows > 1) {
        points.push(null, null);
        continue;
      }
      const inside = [table.at(from, [0])[0]];
      for (let f = Math.ceil(from); f < Math.min(to, table.rows); f++) inside.push(table.values[f]);
      const [low, high] = [Math.min(...inside), Math.max(...inside)];
      points.push(...(inside[0] <= inside[inside.length - 1] ? [low, high] : [high, low]));
    }
    return points;
  }

  /** The numbers under the playhead. */
  update() {
    for (const { values, tables, side } of this.rows) {
      values.forEach((value, i) => {
        const lane = this.lanes[i];
        value.hidden = !this.shown[i] || !tables[i];
        if (value.hidden) return;
        const frame = laneTime(lane, this.playback.time, side) * lane.fps;
        const text = tables[i].at(frame, [0])[0].toFixed(1);
        value.textContent = `${text === '-0.0' ? '0.0' : text}°`;
        value.classList.toggle('ended', laneEnded(lane, this.playback.time, side));
      });
    }
  }
}
