// The panel beside the picture: its buttons, figures and messages, and files that are dropped.

import { megabytes } from "./load.js";

const element = (id) => document.getElementById(id);
const whole = (number) => number.toLocaleString("en");
const share = (part, all) => (all > 0 ? `${((100 * part) / all).toFixed(part < all / 100 ? 1 : 0)}%` : "–");
const TOGGLES = ["walk", "above", "ghosts", "freeze", "measure", "region"];
/** Milliseconds between two changes of the figures. */
const REFRESH_MS = 100;

export class Panel {
  #at = 0;

  constructor(act) {
    this.act = act;
    for (const name of TOGGLES) element(name).addEventListener("click", () => act.toggle(name));
    element("report").addEventListener("click", async () => {
      element("report").disabled = true;
      await act.report().finally(() => (element("report").disabled = false));
    });
    element("scene").addEventListener("change", ({ target }) => {
      if (target.value) act.chooseScene(target.value);
      target.blur();
    });
    element("upright").addEventListener("click", () => act.turnUpright());
    const file = element("file");
    element("choose").addEventListener("click", () => file.click());
    file.addEventListener("change", () => {
      act.openFiles([...file.files]);
      file.value = "";
    });
    element("more").open = !matchMedia("(max-width: 700px)").matches;
    this.#listenToDrops();
    this.say = this.say.bind(this);
  }

  #listenToDrops() {
    let depth = 0;
    const hint = (shown) => (element("drop").hidden = !shown);
    addEventListener("dragenter", () => hint(++depth > 0));
    addEventListener("dragleave", () => hint(--depth > 0));
    addEventListener("dragover", (event) => event.preventDefault());
    addEventListener("drop", (event) => {
      event.preventDefault();
      hint((depth = 0));
      this.act.openFiles([...event.dataTransfer.files]);
    });
  }

  /** Lists the scenes and the cullers that there are. */
  offer(scenes, stages) {
    element("scene").replaceChildren(
      ...scenes.map(([name, { title }]) => new Option(title, name)),
      Object.assign(new Option("your file", ""), { hidden: true }),
    );
    element("stages").replaceChildren(
      ...stages.map(({ name, title }) => {
        const label = document.createElement("label");
        const box = Object.assign(document.createElement("input"), { type: "checkbox", id: `stage-${name}` });
        const left = Object.assign(document.createElement("output"), { id: `left-${name}` });
        box.addEventListener("change", () => {
          const chosen = stages.filter((stage) => element(`stage-${stage.name}`).checked);
          this.act.chooseStages(chosen.map((stage) => stage.name));
          box.blur();
        });
        label.append(box, title, left);
        return label;
      }),
    );
  }

  /** `isFile` is whether a person has opened the model. */
  sceneIs(name, isFile) {
    element("upright").hidden = !isFile;
    const select = element("scene");
    select.value = name;
    if (select.value !== name) select.value = "";
  }

  stagesAre(offered, chosen) {
    for (const box of element("stages").querySelectorAll("input")) {
      const name = box.id.replace("stage-", "");
      box.closest("label").hidden = !offered.includes(name);
      box.checked = chosen.includes(name);
    }
  }

  toggled(name, on) {
    element(name)?.setAttribute("aria-pressed", on);
  }

  /**
   * Shows a message over the lower edge of the picture; an empty one is none. An error stays for 8 seconds.
   */
  say(text, isError = false) {
    const message = element("message");
    if (!text && message.classList.contains("error") && performance.now() < this.until) return;
    message.textContent = text;
    message.hidden = !text;
    message.classList.toggle("error", isError);
    clearTimeout(this.timer);
    if (isError) {
      this.until = performance.now() + 8000;
      this.timer = setTimeout(() => {
        this.until = 0;
        this.say("");
      }, 8000);
    }
  }

  /** Says what the object that was clicked on is, and why it is drawn or not. */
  pickedIs(picked) {
    element("picked").textContent = picked
      ? `${picked.name}, ${whole(picked.triangles)} triangles: ${picked.why}.`
      : "Nothing is there. Click on an object to see why it is drawn or not.";
  }

  show(state, culling, model, visibility) {
    const now = performance.now();
    if (now - this.#at < REFRESH_MS) return;
    this.#at = now;
    element("drawn").textContent = whole(state.visible);
    element("drawnOf").textContent = `of ${whole(state.objects)} objects drawn`;
    element("saved").textContent = share(state.allTriangles - state.triangles, state.allTriangles);
    element("time").textContent = `${state.milliseconds.toFixed(2)} ms`;
    const { check } = state;
    element("wrong").textContent = check ? whole(check.wrongPixels) : "–";
    element("wrong").parentElement.classList.toggle("bad", check?.wrongPixels > 0);
    element("wrongOf").textContent = check ? `wrong of ${whole(check.pixels)} pixels` : "wrong pixels";
    let before = state.objects;
    for (const output of element("stages").querySelectorAll("output")) output.textContent = "";
    for (const [name, left] of culling.left) {
      element(`left-${name}`).textContent = `−${whole(before - left)}`;
      before = left;
    }
    element("ofBox").hidden = !state.region;
    element("ofView").hidden = Boolean(state.region);
    for (const [name, count] of Object.entries(state.region ?? {})) {
      const output = element(`box-${name}`);
      if (output) output.textContent = whole(count);
    }
    if (state.region) element("box-swept").textContent = whole(state.objects - state.region.swept);
    element("details").textContent = this.#details(state, culling, model, visibility).join("\n");
  }

  #details(state, culling, model, visibility) {
    const { check, facts } = state;
    const { made, all, milliseconds, isDone } = culling.occluders;
    const lines = [
      `triangles ${whole(state.triangles)} of ${whole(state.allTriangles)}, ${state.calls} draw calls`,
      `promise   ${culling.pipeline.accuracy}`,
      `occluders ${whole(made)} of ${whole(all)}${isDone ? `, ${milliseconds.toFixed(0)} ms` : " so far"}`,
    ];
    if (culling.online) lines.push(`ahead     answer by: ${culling.online.answer}`);
    for (const [name, { reason, ageMs, workerMs }] of culling.workers?.answers ?? [])
      lines.push(`${name.padEnd(10)}${reason || `${ageMs.toFixed(0)} ms old`}, took ${workerMs.toFixed(0)} ms`);
    if (culling.workers?.boxes !== undefined) {
      const { boxes, box, bakeMs } = culling.workers;
      const here = box ? `${whole(box.hidden)} objects hidden from here` : "this cell is not baked yet";
      lines.push(`bake      ${boxes} cells, ${here}, took ${bakeMs.toFixed(0)} ms`);
    }
    if (check) {
      lines.push(`in truth  ${whole(check.shown)} solid objects show`);
      if (check.wrongObjects > 0) lines.push(`missing   ${whole(check.wrongObjects)} objects that show`);
      lines.push(
        `overdraw  ${check.surfaces.toFixed(2)} of ${check.allSurfaces.toFixed(2)} surfaces a pixel`,
      );
    }
    if (model.loose.length > 0)
      lines.push(`always    ${whole(model.loose.length)} animated meshes, lines, points`);
    const { geometry, textures } = model.bytes;
    const memory = [
      facts.bytes ? `file ${megabytes(facts.bytes)}` : null,
      `geometry ${megabytes(geometry)}`,
      textures ? `pictures ${megabytes(textures)}` : null,
      `culling ${megabytes(visibility.memory.buffer.byteLength)}`,
    ];
    lines.push(`memory    ${memory.filter(Boolean).join(", ")}`);
    lines.push(
      `loaded in ${(state.loadMs / 1000).toFixed(2)} s, module ${visibility.simd128 ? "simd128" : "plain"}`,
    );
    return lines;
  }
}
