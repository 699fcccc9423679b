"use strict";
// The player's bar: slider with ticks where checks are nearest to their limits, and red where bodies touch.
const OptiPlanTimeline = (() => {
  const { make } = OptiPlanCurves, byId = (id) => document.getElementById(id);

  function wire(clock) {
    for (const speed of OptiPlanClock.SPEEDS) byId("speed").append(new Option(speed + "×", String(speed)));
    byId("speed").addEventListener("change", (event) => clock.setSpeed(Number(event.target.value)));
    byId("loop").addEventListener("change", (event) => { clock.loop = event.target.checked; });
    byId("scrub").addEventListener("input", (event) => clock.jump(Number(event.target.value) * clock.duration));
    byId("scrub").addEventListener("change", () => byId("scrub").blur()); // the space bar plays again
    byId("play").addEventListener("click", () => clock.toggle());
    clock.listen(() => {
      byId("play").disabled = byId("scrub").disabled = clock.still;
      byId("scrub").value = clock.duration ? clock.time / clock.duration : 0;
      byId("scrub").setAttribute("aria-valuetext", clock.time.toFixed(2) + " s");
      byId("clock").textContent = clock.time.toFixed(2) + " / " + clock.duration.toFixed(2) + " s";
      byId("play").setAttribute("aria-pressed", String(clock.playing));
      byId("speed").value = String(clock.speed);
    });
  }

  // Where a share of the time is on the slider, whose knob keeps half its width from both ends.
  const place = (share) => `calc(8px + ${share} * (100% - 16px))`;

  // Ticks of a run's checks and red bands of its contacts.
  function mark(clock, run, jump) {
    const ticks = [], bands = [], share = (t) => Math.min(1, t / (clock.duration || 1));
    for (const [from, to] of (run.clearance && run.clearance.contacts) || []) {
      const band = make("span", "band");
      band.style.left = place(share(from));
      band.style.width = `max(3px, calc(${share(to) - share(from)} * (100% - 16px)))`;
      band.title = `bodies overlap from ${from.toFixed(3)} to ${to.toFixed(3)} s`;
      bands.push(band);
    }
    for (const check of run.checks) {
      if (check.time === null || check.time === undefined || !clock.duration) continue;
      const tick = make("span", check.passed ? "at" : "at failed");
      tick.style.left = place(share(check.time));
      tick.title = `${check.name}: ${OptiPlanVerdict.figures(check)} ${check.joint || ""}`;
      tick.addEventListener("click", () => jump(check));
      ticks.push(tick);
    }
    byId("ticks").replaceChildren(...bands, ...ticks);
  }

  return { wire, mark, place };
})();
