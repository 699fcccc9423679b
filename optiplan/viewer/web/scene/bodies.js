"use strict";
// How bodies are painted: as they are, red where they touch, lit where a joint is pointed at, see-through where they hide.
const OptiPlanBodies = (() => {
  const THREE = MeshCat.THREE, { named } = OptiPlanShapes;
  const RED = "#d3261f", LIT = "#f2a900";

  class Painter {
    constructor() { this.made = new Map(); }

    // The material of a mesh, changed: `red`, `lit`, `through`, since it is wished, or `aside`, since it hides what touches. Each combination is made once.
    variant(base, { red, lit, through, aside }) {
      const key = [base.uuid, red, lit, through || aside].join();
      if (!this.made.has(key)) {
        const look = base.clone();
        if (red && look.color) { look.color = named(RED); if (look.emissive) look.emissive = named("#4a0805"); }
        else if (lit && look.emissive) { look.emissive = named(LIT); look.emissiveIntensity = 0.42; }
        if (through || aside) Object.assign(look, { transparent: true, opacity: red ? 0.5 : 0.22, depthWrite: false });
        this.made.set(key, look);
      }
      return this.made.get(key);
    }

    paint(mesh, change) {
      const data = mesh.userData;
      data.base = data.base || mesh.material;
      data.look = { red: false, lit: false, through: false, aside: false, ...data.look, ...change };
      const plain = !Object.values(data.look).includes(true);
      mesh.material = plain ? data.base : this.variant(data.base, data.look);
    }
  }

  // Texts that stay at a point of the scene.
  class Labels {
    constructor(element) { Object.assign(this, { element, shown: [] }); }

    add(text, kind = "") {
      const label = document.createElement("div");
      label.className = "label " + kind;
      label.textContent = text;
      label.hidden = true;
      this.element.append(label);
      const one = { element: label, point: new THREE.Vector3(), visible: true, lift: 0 };
      this.shown.push(one);
      return one;
    }

    remove(one) { one.element.remove(); this.shown = this.shown.filter((other) => other !== one); }

    // After the scene was drawn; points are in the world of three.js. Labels that would overlap give way downwards.
    place(camera, width, height) {
      const p = new THREE.Vector3(), taken = [];
      for (const { element, point, visible, lift } of this.shown) {
        p.copy(point).project(camera);
        const inside = visible && p.z < 1 && Math.abs(p.x) < 1 && Math.abs(p.y) < 1;
        if (element.hidden !== !inside) element.hidden = !inside;
        if (!inside) continue;
        const w = element.offsetWidth, h = element.offsetHeight;
        const x = Math.min(width - w - 4, Math.max(4, 0.5 * (p.x + 1) * width + 12));
        let y = Math.min(height - h - 4, Math.max(4, 0.5 * (1 - p.y) * height - 0.5 * h - lift));
        for (const other of taken) if (x < other.x + other.w && other.x < x + w && y < other.y + other.h + 2 && other.y < y + h + 2) y = other.y + other.h + 3;
        taken.push({ x, y, w, h });
        element.style.transform = `translate(${x.toFixed(0)}px, ${y.toFixed(0)}px)`;
      }
    }
  }
  return { Painter, Labels, RED };
})();
