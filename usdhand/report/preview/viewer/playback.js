// Time: one clock for all lanes, in seconds from the clips' first frames.

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

export class Playback {
  constructor(duration, fps, changed) {
    this.duration = duration;
    this.fps = fps;
    this.changed = changed;
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.loop = true;
    this.last = null;
  }

  play(on = !this.playing) {
    if (on && this.time >= this.duration) this.time = 0;
    this.playing = on && this.duration > 0;
    this.last = null;
    this.changed();
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.changed();
  }

  /** Moves to a time, and stops there. */
  stopAt(time) {
    this.playing = false;
    this.seek(time);
  }

  /** Moves to a frame `count` frames away, and stops there. */
  step(count) {
    this.stopAt((Math.round(this.time * this.fps) + count) / this.fps);
  }

  setSpeed(speed) {
    this.speed = speed;
    this.changed();
  }

  faster(places) {
    const at = SPEEDS.indexOf(this.speed) + places;
    this.setSpeed(SPEEDS[Math.min(Math.max(at, 0), SPEEDS.length - 1)]);
  }

  /** Goes on by the time that has passed since the last call; `now` in milliseconds. */
  tick(now) {
    if (!this.playing) return;
    // A page that was hidden for a while goes on where it was.
    const passed = this.last === null ? 0 : Math.min((now - this.last) / 1000, 1);
    this.last = now;
    const time = this.time + passed * this.speed;
    if (time < this.duration) return this.seek(time);
    if (!this.loop) this.playing = false;
    this.seek(this.loop ? time % this.duration : this.duration);
  }
}

/** Whether a lane shows nothing of its own at a time of the page, since its motion is over. */
export function laneEnded(lane, time, side) {
  const warp = lane.retime[side] ?? lane.retime.right ?? lane.retime.left;
  // Where the other clip goes on, a hand clip that is over stands still.
  const last = warp && warp[warp.length - 1][1];
  const end = warp ? warp.find(([, seconds]) => seconds >= last)[0] : lane.duration;
  return time > end + 0.5 / lane.fps;
}

/** Seconds of a lane's own clip at a time of the page, for the hand that is looked at. */
export function laneTime(lane, time, side) {
  const warp = lane.retime[side] ?? lane.retime.right ?? lane.retime.left;
  if (!warp) return time;
  let low = 0;
  let high = warp.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (warp[middle][0] <= time) low = middle;
    else high = middle;
  }
  const [[a, u], [b, v]] = [warp[low], warp[high]];
  const share = b > a ? Math.min(Math.max((time - a) / (b - a), 0), 1) : 0;
  return u + share * (v - u);
}
