// The timeline: scrubbing, rows of segments and phases, the playhead across all rows.

import { element } from 'dom';

const LEAST_LABEL = 0.045; // of the timeline's width: narrower spans have no text

export class Timeline {
  constructor(root, playback, rows) {
    this.playback = playback;
    this.root = root;
    this.slider = root.querySelector('#scrub');
    this.now = root.querySelector('#time');
    this.slider.max = playback.duration;
    this.slider.step = 'any';
    this.slider.addEventListener('input', () => playback.seek(Number(this.slider.value)));
    const box = root.querySelector('#rows');
    this.rows = rows.map((row) => this.#row(row));
    box.append(...this.rows.flatMap((row) => row.cells));
    this.borders = borders(rows);
    this.#scrubOn(root);
  }

  /** Goes to the next border of a segment or phase, or pin; the one before for -1. */
  toBorder(direction) {
    const { time } = this.playback;
    const ahead = this.borders.filter((t) => direction * (t - time) > 1e-3);
    if (ahead.length === 0) return;
    this.playback.stopAt(direction > 0 ? Math.min(...ahead) : Math.max(...ahead));
  }

  update(text) {
    const { time, duration } = this.playback;
    this.slider.value = time;
    this.slider.setAttribute('aria-valuetext', text);
    this.now.textContent = text;
    this.root.style.setProperty('--at', duration ? time / duration : 0);
    for (const { row, value } of this.rows) {
      const span = row.spans.find((s) => s.start <= time && time < s.end);
      const mark = row.marks.findLast((m) => m.time <= time);
      const words = span?.detail ?? mark?.detail ?? '';
      if (value.textContent !== words) value.textContent = words;
    }
  }

  #row(row) {
    const name = `${row.label}, ${row.side}`;
    const track = element('div', { class: 'track spans', role: 'img' });
    track.setAttribute('aria-label', `${name}, ${row.lane}: ${many(row.spans, 'span')}, ${many(row.marks, 'mark')}`);
    const place = (time) => `${(100 * time) / (this.playback.duration || 1)}%`;
    row.spans.forEach((span, i) => {
      const box = element('span', { class: `span ${i % 2 ? 'odd' : ''} ${span.look ? 'look' : ''}` });
      box.style.left = place(span.start);
      box.style.width = place(span.end - span.start);
      box.title = `${span.start.toFixed(2)} to ${span.end.toFixed(2)} s: ${span.detail}`;
      const wide = (span.end - span.start) / (this.playback.duration || 1) > LEAST_LABEL;
      if (wide) box.textContent = span.label;
      track.append(box);
    });
    for (const mark of row.marks) {
      const box = element('span', { class: 'mark' }, mark.label);
      box.style.left = place(mark.time);
      box.title = mark.detail;
      track.append(box);
    }
    const label = element('span', { class: `label ${row.side}` }, name);
    label.append(element('small', {}, row.lane));
    label.title = [row.lane, row.source].filter(Boolean).join(': ');
    const value = element('span', { class: 'value' });
    return { row, value, cells: [label, track, value] };
  }

  /** Dragging on any track scrubs, as on the slider itself. */
  #scrubOn(root) {
    const move = (event, track) => {
      const box = track.getBoundingClientRect();
      this.playback.seek(((event.clientX - box.left) / box.width) * this.playback.duration);
    };
    root.addEventListener('pointerdown', (event) => {
      const track = event.target.closest('.track');
      if (!track || event.button !== 0) return;
      event.preventDefault();
      this.playback.play(false);
      const drag = (e) => move(e, track);
      const stop = () => {
        window.removeEventListener('pointermove', drag);
        window.removeEventListener('pointerup', stop);
        window.removeEventListener('pointercancel', stop);
      };
      window.addEventListener('pointermove', drag);
      window.addEventListener('pointerup', stop);
      window.addEventListener('pointercancel', stop);
      move(event, track);
    });
  }
}

function many(items, noun) {
  return `${items.length} ${noun}${items.length === 1 ? '' : 's'}`;
}

function borders(rows) {
  const times = rows.flatMap((row) => [
    ...row.spans.flatMap((s) => [s.start, s.end]),
    ...row.marks.map((m) => m.time),
  ]);
  return [...new Set(times)].sort((a, b) => a - b);
}
