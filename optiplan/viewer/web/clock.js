"use strict";
// The one time of a page, s: the scene, the curves and the slider listen to it, and each of them may move it.
const OptiPlanClock = (() => {
  const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4], LEAST = 1e-3, REST = 0.7; // s: the shortest range; standing at the end before the motion begins again

  class Clock {
    // `end`: where playing stops, before `duration` for a motion that is shown up to a contact.
    constructor(duration, end = duration) {
      Object.assign(this, { duration, end, time: 0, speed: 1, playing: false, loop: true, waited: 0, heard: [], range: null });
    }

    // What is looked at and played again and again: [from, to], s; null for the whole.
    view(range) {
      const [from, to] = range ? [Math.max(0, Math.min(...range)), Math.min(this.duration, Math.max(...range))] : [0, this.duration];
      this.range = to - from < LEAST || (from <= 0 && to >= this.duration) ? null : [from, to];
      if (this.range && (this.time < from || this.time > to)) this.time = from;
      this.tell();
    }

    // Calls `listener(clock)` at every change of time, speed or playing, and once now.
    listen(listener) { this.heard.push(listener); listener(this); }
    tell() { for (const listener of this.heard) listener(this); }
    get still() { return this.duration === 0; }

    // What is shown lasts another time now.
    last(duration, end = duration) {
      if (duration === this.duration && end === this.end) return;
      Object.assign(this, { duration, end, time: Math.min(this.time, duration), range: null });
      this.tell();
    }

    seek(t) { this.time = Math.min(this.duration, Math.max(0, t)); this.waited = 0; this.tell(); }
    pause() { this.playing = false; this.tell(); }
    play() {
      if (this.still) return;
      if (this.time >= (this.range ? this.range[1] : this.end)) this.seek(this.range ? this.range[0] : 0);
      this.playing = true;
      this.tell();
    }
    toggle() { if (this.playing) this.pause(); else this.play(); }
    jump(t) { this.playing = false; this.seek(t); }
    setSpeed(speed) { if (SPEEDS.includes(speed)) { this.speed = speed; this.tell(); } }
    step(steps) { this.setSpeed(SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, SPEEDS.indexOf(this.speed) + steps))]); }

    // Moves on by `dt` seconds of the wall, if it plays.
    advance(dt) {
      if (!this.playing) return;
      if (this.range && this.time >= this.range[1] && this.time <= this.range[1] + LEAST) {
        if (!this.loop) this.playing = false;
        else if ((this.waited += dt) > REST) { this.time = this.range[0]; this.waited = 0; }
        this.tell();
        return;
      }
      const end = this.range && this.time < this.range[1] ? this.range[1] : this.time > this.end ? this.duration : this.end;
      if (this.time < end) this.time = Math.min(end, this.time + dt * this.speed);
      else if (this.following && (this.waited += dt) > REST && this.following()) this.waited = 0; // another motion begins
      else if (!this.loop) this.playing = false;
      else if (this.following || (this.waited += dt) > REST) { if (this.waited > REST) { this.time = 0; this.waited = 0; } }
      this.tell();
    }
  }
  return { Clock, SPEEDS };
})();
