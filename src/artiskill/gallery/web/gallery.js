"use strict";
// Lists, filters and shows the objects of objects.js. Pictures are columns of steps and rows of views in one image.
(() => {
  const { objects, steps, views, width, height, sheets } = window.GALLERY;
  const byId = (id) => document.getElementById(id);
  const form = byId("filters"), grid = byId("grid"), dialog = byId("detail");
  const chosen = { category: new Set(), split: new Set() };
  let shown = [], current = null;

  const make = (tag, properties = {}, ...children) => {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  };
  const words = (text) => text.replaceAll("_", " ");
  const labelOf = (key) => words(key).replace(/ (m|mm|kg|l|deg)$/, ", $1");
  const number = (value) => Number(value.toPrecision(3)).toString();
  const sizeOf = (object) => {
    const [depth, wide, high] = object.size_m.map((v) => Math.round(100 * v));
    return `${wide} × ${depth} × ${high} cm`;
  };
  const plural = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

  // ---- pictures
  const frame = (object, view, lazy) => {
    const image = make("img", { alt: "", draggable: false });
    if (lazy) image.loading = "lazy";
    image.style.width = `${100 * steps}%`;
    image.style.height = `${100 * views}%`;
    image.src = object.picture;
    const box = make("div", { className: "frame" }, image);
    box.style.aspectRatio = `${width} / ${height}`;
    box.show = (step) => { image.style.transform = `translate(${-100 * step / steps}%, ${-100 * view / views}%)`; };
    box.show(0);
    return box;
  };
  const slider = (label, onInput) => {
    const input = make("input", { type: "range", min: 0, max: steps - 1, value: 0 });
    input.setAttribute("aria-label", label);
    input.addEventListener("input", () => onInput(Number(input.value)));
    return input;
  };

  // ---- cards
  const cardOf = (object) => {
    const picture = frame(object, 0, true);
    const open = make("button", { type: "button", className: "open" }, picture);
    open.setAttribute("aria-label", `${object.id}: details`);
    open.addEventListener("click", () => show(object));
    const range = slider(`open ${object.id}`, picture.show);
    const split = make("span", { className: `split ${object.split}`, textContent: object.split });
    const about = [plural(object.joints.length, "joint"), ...new Set(object.handles)].join(", ");
    const card = make("li", { className: "card" }, open, make("div", { className: "text" }, range,
      make("h3", {}, object.id, split),
      make("p", { textContent: `${words(object.family)}, ${sizeOf(object)}` }),
      make("p", { textContent: `${about}, ${number(object.mass_kg)} kg` })));
    card.openTo = (step) => { range.value = step; picture.show(step); };
    return card;
  };
  const cards = new Map(objects.map((object) => [object, cardOf(object)]));

  // ---- filters
  const order = ["cabinet", "chair", "bucket", "train", "test", "ood"];
  const haystack = new Map(objects.map((object) => [object, words([
    object.id, object.category, object.split, object.family, ...object.handles, ...object.tags,
    ...object.more.flat()].join(" ")).toLowerCase()]));
  const rank = (name) => { const place = order.indexOf(name); return place < 0 ? order.length : place; };
  const byName = (a, b) => rank(a.category) - rank(b.category) || a.id.localeCompare(b.id, "en", { numeric: true });
  const keys = {
    id: () => 0, height: (o) => o.size_m[2], width: (o) => o.size_m[1], mass: (o) => o.mass_kg,
    joints: (o) => o.joints.length, triangles: (o) => o.triangles,
  };
  const values = (of) => [...new Set(objects.flatMap(of))].sort();

  const fillSelect = (name, options) => {
    const select = form.elements[name];
    select.append(make("option", { value: "", textContent: "any" }));
    for (const value of options) select.append(make("option", { value, textContent: words(value) }));
    select.disabled = options.length === 0;
  };
  const fillChips = (name) => {
    const box = form.querySelector(`[data-chips=${name}]`);
    const found = values((object) => object[name]).sort((a, b) => rank(a) - rank(b));
    for (const value of found) {
      const count = objects.filter((object) => object[name] === value).length;
      const chip = make("button", { type: "button", textContent: `${value} ${count}` });
      chip.dataset.value = value;
      chip.setAttribute("aria-pressed", "false");
      chip.addEventListener("click", () => {
        if (!chosen[name].delete(value)) chosen[name].add(value);
        apply();
      });
      box.append(chip);
    }
  };
  const passes = (object) => {
    const given = Object.fromEntries(["text", "family", "handle", "tag", "least", "most"].map(
      (name) => [name, form.elements[name].value.trim()]));
    const joints = object.joints.length;
    return Object.keys(chosen).every((name) => !chosen[name].size || chosen[name].has(object[name]))
      && (!given.family || object.family === given.family)
      && (!given.handle || object.handles.includes(given.handle))
      && (!given.tag || object.tags.includes(given.tag))
      && (given.least === "" || joints >= Number(given.least))
      && (given.most === "" || joints <= Number(given.most))
      && given.text.toLowerCase().split(/\s+/).every((word) => haystack.get(object).includes(word));
  };
  const apply = () => {
    const key = keys[form.elements.order.value];
    shown = objects.filter(passes).sort((a, b) => key(a) - key(b) || byName(a, b));
    grid.replaceChildren(...shown.map((object) => cards.get(object)));
    byId("none").hidden = shown.length > 0;
    byId("count").textContent = `${shown.length} of ${plural(objects.length, "object")}`;
    for (const chip of form.querySelectorAll(".chips button")) {
      const name = chip.parentElement.dataset.chips;
      chip.setAttribute("aria-pressed", String(chosen[name].has(chip.dataset.value)));
    }
    remember();
  };
  const clear = () => {
    form.reset();
  };

  // ---- the address keeps filters and the open object, for links and the back button
  const fields = ["text", "family", "handle", "tag", "least", "most", "order"];
  const remember = () => {
    const state = new URLSearchParams();
    for (const name of fields) {
      const value = form.elements[name].value;
      if (value && !(name === "order" && value === "id")) state.set(name, value);
    }
    for (const name of Object.keys(chosen)) if (chosen[name].size) state.set(name, [...chosen[name]].join(","));
    if (current) state.set("object", current.id);
    const hash = state.size || [...state].length ? `#${state}` : "";
    if (hash !== location.hash && !(hash === "" && ["#grid", "#statistics", "#sheets"].includes(location.hash))) {
      history.replaceState(null, "", hash || location.pathname + location.search);
    }
  };
  const recall = () => {
    const state = new URLSearchParams(location.hash.slice(1));
    for (const name of fields) if (state.has(name)) form.elements[name].value = state.get(name);
    for (const name of Object.keys(chosen)) chosen[name] = new Set((state.get(name) || "").split(",").filter(Boolean));
    const object = objects.find((candidate) => candidate.id === state.get("object"));
    apply();
    if (object) show(object);
  };

  // ---- details
  const row = (name, value) => make("tr", {}, make("th", { scope: "row", textContent: name }), make("td", { textContent: value }));
  const rangeOf = (joint) => joint.range === null ? "without end"
    : joint.kind === "prismatic" ? `${number(1000 * joint.range)} mm` : `${number(joint.range)}°`;
  const show = (object) => {
    current = object;
    byId("detail-title").textContent = object.id;
    const frames = Array.from({ length: views }, (_, view) => frame(object, view, false));
    byId("detail-views").replaceChildren(...frames);
    const range = byId("detail-slider");
    range.oninput = () => frames.forEach((box) => box.show(Number(range.value)));
    range.oninput();
    byId("detail-code").textContent = object.split === "imported" || object.split === "own"
      ? `artiskill.load_object(path) of ${object.id}` : `artiskill.load_object("${object.id}")`;
    const handles = [...new Set(object.handles)].map((kind) => {
      const count = object.handles.filter((other) => other === kind).length;
      return count > 1 ? `${count} × ${kind}` : kind;
    });
    byId("detail-facts").tBodies[0].replaceChildren(
      row("category", object.category), row("split", object.split), row("family", words(object.family)),
      row("width × depth × height", sizeOf(object)), row("mass", `${number(object.mass_kg)} kg`),
      row("handles", handles.map(words).join(", ") || "none"), row("tags", object.tags.map(words).join(", ") || "none"),
      ...object.more.map(([name, value]) => row(labelOf(name), words(value))),
      row("triangles, collision shapes", `${object.triangles}, ${object.shapes}`), row("content hash", object.content_hash));
    byId("detail-joints").tBodies[0].replaceChildren(...object.joints.map((joint) => make("tr", {},
      ...[joint.name, joint.link, joint.kind + (joint.spring ? ", spring" : ""), rangeOf(joint)].map(
        (text) => make("td", { textContent: text })))));
    if (!dialog.open) dialog.showModal();
    dialog.scrollTop = 0;
    range.focus({ preventScroll: true });
    remember();
  };
  const move = (by) => {
    if (!shown.length) return;
    const place = shown.indexOf(current);
    show(shown[(place + by + shown.length) % shown.length]);
  };

  // ---- start
  for (const name of ["category", "split"]) fillChips(name);
  fillSelect("family", values((object) => object.family));
  fillSelect("handle", values((object) => object.handles));
  fillSelect("tag", values((object) => object.tags));
  form.addEventListener("input", apply);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("reset", () => {
    for (const name of Object.keys(chosen)) chosen[name].clear();
    setTimeout(apply);
  });
  byId("clear").addEventListener("click", clear);
  const all = byId("open-all");
  all.max = byId("detail-slider").max = steps - 1;
  all.value = 0;
  all.addEventListener("input", () => cards.forEach((card) => card.openTo(Number(all.value))));
  byId("previous").addEventListener("click", () => move(-1));
  byId("next").addEventListener("click", () => move(1));
  byId("close").addEventListener("click", () => dialog.close());
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });
  dialog.addEventListener("close", () => {
    const card = cards.get(current);
    current = null;
    remember();
    if (card && card.isConnected) card.querySelector("button").focus();
  });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (dialog.open) {
      if (event.key === "n") move(1);
      if (event.key === "p") move(-1);
    } else if (event.key === "/" && !/INPUT|SELECT/.test(document.activeElement.tagName)) {
      event.preventDefault();
      form.elements.text.focus();
    }
  });
  byId("sheet-links").append(...sheets.map((path) => make("li", {},
    make("a", { href: path, textContent: path.replace(/^.*\/|\.\w+$/g, "").replaceAll("-", ", ") }))));
  recall();
})();
