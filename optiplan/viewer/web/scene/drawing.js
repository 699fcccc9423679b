"use strict";
// What a user's own script draws by meshcat's protocol: messages of the server, given to meshcat's viewer in our scene.
const OptiPlanDrawing = (() => {
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

  class Drawing {
    // `tell` shows words; `drawn` are messages that the page was made with.
    constructor(scene, drawn, tell) {
      Object.assign(this, { scene, tell, paths: new Set(), messages: 0, failures: [], connected: false, animated: false });
      for (const message of drawn) this.take(message);
    }

    // Takes what the server sends from now on; the browser comes back by itself when the line breaks.
    listen(address) {
      this.address = address;
      this.source = new EventSource(address);
      this.source.addEventListener("open", () => { this.connected = true; });
      this.source.addEventListener("error", () => { if (this.connected) this.tell("what scripts draw is not shown: the server is away"); this.connected = false; });
      this.source.addEventListener("message", (event) => { for (const message of JSON.parse(event.data)) this.take(message); });
    }

    take([command, ...rest]) {
      try {
        if (command === "reset") this.clear();
        else if (command === "trouble") this.tell(rest[0]);
        else if (command === "picture") this.picture(rest[0]);
        else this.draw(command, ...rest);
      } catch (error) {
        this.failures.push(`${command} ${rest[0]}: ${error.message}`);
        this.tell(`a script's ${command} of ${rest[0]} cannot be drawn: ${error.message}`);
      }
    }

    draw(command, path, packed) {
      const first = path.split("/").find((name) => name);
      if (command === "delete" && !first) { this.clear(); return; }
      if (first) this.paths.add(first);
      this.messages += 1;
      this.scene.viewer.handle_command_bytearray(bytes(packed));
      if (command === "set_animation") this.animate();
      this.scene.dirty();
    }

    clear() {
      for (const path of this.paths) this.scene.viewer.handle_command({ type: "delete", path: `/${path}` });
      this.paths.clear();
      this.tell("");
      this.scene.dirty();
    }

    // meshcat's animations run on their own clock, that of the wall.
    animate() {
      if (this.animated) return;
      this.animated = true;
      const step = () => { this.scene.viewer.animator.update(); requestAnimationFrame(step); };
      requestAnimationFrame(step);
    }

    async picture(number) {
      this.scene.draw(true);
      const body = this.scene.viewer.renderer.domElement.toDataURL("image/png");
      await fetch(`${this.address}?picture=${number}`, { method: "POST", body });
    }

    // Objects that scripts have drawn, by path.
    object(path) { return this.scene.viewer.scene_tree.find(path.split("/").filter((name) => name)).object; }
  }
  return { Drawing };
})();
