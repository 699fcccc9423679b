"use strict";
// Bodies that are clicked on: hidden, or their names pinned so that they stay while the body moves.
const OptiPlanPicked = (() => {
  const THREE = MeshCat.THREE, { make } = OptiPlanCurves;
  const SEEN = 0, HIDDEN = 31; // layers of three.js: neither cameras nor rays of ours look into the last one
  const STILL = 4; // pixels: a pointer that went farther has turned the view

  class Picked {
    // `list`: the element that names what is hidden; `changed()`: what is seen has changed; `run()`: of the scene, whose bodies bear the names.
    constructor(scene, pane, list, changed, run) {
      Object.assign(this, { scene, pane, list, changed, run, hidden: new Set(), pins: new Map() });
      this.card = make("div", "picked");
      this.card.hidden = true;
      pane.parentElement.append(this.card);
      let down = null;
      pane.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY]; this.card.hidden = true; });
      pane.addEventListener("pointerup", (event) => {
        if (!down || event.button || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > STILL) return;
        const box = pane.getBoundingClientRect();
        this.offer(event.clientX - box.left, event.clientY - box.top);
      });
      addEventListener("keydown", (event) => { if (event.key === "Escape") this.card.hidden = true; });
      this.fill();
    }

    // What can be done with the body under a place of the picture.
    offer(x, y) {
      const name = this.scene.bodyAt(x, y);
      if (name === null) return;
      const button = (text, act) => {
        const one = make("button", "", text);
        one.type = "button";
        one.addEventListener("click", () => { this.card.hidden = true; act(); });
        return one;
      };
      this.card.replaceChildren(make("b", "", name), button("Hide", () => this.hide(name, true)), button(this.pins.has(name) ? "Unpin name" : "Pin name", () => this.pin(name, !this.pins.has(name))));
      this.card.hidden = false;
      this.card.style.left = `${Math.max(4, Math.min(x, this.scene.width - this.card.offsetWidth - 4))}px`;
      this.card.style.top = `${Math.max(4, Math.min(y + 8, this.scene.height - this.card.offsetHeight - 4))}px`;
    }

    hide(name, on) {
      if (on) this.hidden.add(name); else this.hidden.delete(name);
      for (const mesh of this.scene.owned(name)) mesh.layers.set(on ? HIDDEN : SEEN);
      if (on) this.pin(name, false);
      this.fill();
      this.scene.dirty();
      this.changed();
    }

    pin(name, on) {
      const label = this.pins.get(name);
      if (label && !on) { this.scene.labels.remove(label); this.pins.delete(name); }
      if (!label && on) {
        const made = this.scene.labels.add(name, "pin");
        this.pins.set(name, made);
      }
      this.scene.dirty(false);
      this.changed();
    }

    // Before the scene is drawn: pinned names go with their bodies.
    update() {
      if (!this.pins.size) return;
      const box = new THREE.Box3();
      this.scene.root.updateMatrixWorld(); // bodies have been moved since the last picture
      for (const [name, label] of this.pins) {
        box.makeEmpty();
        for (const mesh of this.scene.owned(name, this.run())) if (mesh.visible) box.expandByObject(mesh);
        label.visible = !box.isEmpty();
        if (label.visible) box.getCenter(label.point);
      }
    }

    // What is hidden, each with a way back.
    fill() {
      this.list.hidden = !this.hidden.size;
      const title = make("span", "", "Hidden:");
      this.list.replaceChildren(title, ...[...this.hidden].map((name) => {
        const back = make("button", "", `${name} ×`);
        back.type = "button";
        back.title = `Show ${name} again`;
        back.addEventListener("click", () => this.hide(name, false));
        return back;
      }));
    }

    // What the address holds and brings back.
    get wish() { return { hidden: [...this.hidden], pinned: [...this.pins.keys()] }; }
    set wish({ hidden, pinned }) {
      for (const name of this.hidden) if (!hidden.includes(name)) this.hide(name, false);
      for (const name of this.pins.keys()) if (!pinned.includes(name)) this.pin(name, false);
      for (const name of hidden) if (this.scene.owned(name).length) this.hide(name, true);
      for (const name of pinned) if (this.scene.owned(name).length) this.pin(name, true);
    }
  }
  return { Picked };
})();
