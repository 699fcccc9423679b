"use strict";
// Pictures and films of the scene, made in the browser and saved as files.
const OptiPlanPictures = (() => {
  const RATE = 30; // frames a second of a film
  const STAND = 300, PATIENCE = 20_000; // ms at the end of a film: always, and at the most

  function save(blob, name) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 5000);
  }

  const safe = (name) => name.replace(/[^\w.-]+/g, "_");

  // The scene at `times` its size, with a line of text; a canvas.
  function canvas(app, times) {
    const { scene, data, clock } = app, { renderer } = scene.viewer, before = renderer.getPixelRatio();
    renderer.setPixelRatio(times);
    renderer.setSize(scene.width, scene.height);
    scene.draw(true);
    const found = document.createElement("canvas"), source = renderer.domElement, run = data.runs[app.selected];
    Object.assign(found, { width: source.width, height: source.height });
    const pen = found.getContext("2d");
    pen.drawImage(source, 0, 0);
    pen.scale(times, times);
    pen.font = "13px system-ui, sans-serif";
    pen.fillStyle = OptiPlanCurves.css("--soft");
    pen.fillText(`${data.name}${run ? ` · ${run.label} · ${run.badge}` : ""} · ${clock.time.toFixed(3)} s`, 12, scene.height - 12);
    renderer.setPixelRatio(before);
    renderer.setSize(scene.width, scene.height);
    scene.dirty(false);
    return found;
  }

  // A PNG at twice the size of the scene.
  function picture(app) {
    return new Promise((done) => canvas(app, 2).toBlob((blob) => { save(blob, `${safe(app.data.name)}-${app.clock.time.toFixed(2)}s.png`); done(blob); }, "image/png"));
  }

  // A WebM of the motion from beginning to end, at the speed that is set; it takes as long as the motion does.
  async function film(app, told = () => {}) {
    const { scene, clock } = app, type = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"].find((one) => window.MediaRecorder && MediaRecorder.isTypeSupported(one));
    if (!type || clock.still) throw new Error(clock.still ? "there is no motion to film" : "this browser does not record films");
    const recorder = new MediaRecorder(scene.viewer.renderer.domElement.captureStream(RATE), { mimeType: type, videoBitsPerSecond: 8e6 }), parts = [];
    recorder.ondataavailable = (event) => parts.push(event.data);
    const ended = new Promise((done) => { recorder.onstop = done; });
    clock.pause();
    clock.seek(0);
    scene.draw(true);
    recorder.start(100); // ms between parts
    const begun = performance.now();
    for (let t = 0; t < clock.end;) {
      await new Promise(requestAnimationFrame);
      t = Math.min(clock.end, ((performance.now() - begun) / 1000) * clock.speed);
      clock.seek(t);
      scene.draw(true);
      told(t / clock.end);
    }
    // It stands at the end; on a busy machine until the recorder has caught a picture at all.
    const over = performance.now(), caught = () => parts.some((part) => part.size > 1000);
    for (let rest = 0; rest < STAND || (!caught() && rest < PATIENCE); rest = performance.now() - over) {
      await new Promise(requestAnimationFrame);
      scene.draw(true);
    }
    recorder.stop();
    await ended;
    const blob = new Blob(parts, { type: "video/webm" });
    save(blob, `${safe(app.data.name)}.webm`);
    return blob;
  }

  return { canvas, picture, film };
})();
