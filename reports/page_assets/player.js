"use strict";
// The motion player: several bodies side by side, one clock. Motions come from data/<table>.js, a file a table.
window.stylebench = (() => {
  const element = document.getElementById("player");
  const loaded = new Map();
  let waiting = null;
  if (!element) return { load() {} };

  const find = (name) => element.querySelector(`[data-part="${name}"]`);
  const [tableMenu, sampleMenu, rowBoxes, playButton, scrubber, speedMenu, canvas, said, orderMenu, trailBox] =
    ["table", "sample", "rows", "play", "frame", "speed", "canvas", "said", "order", "trails"].map(find);
  const state = { table: null, sample: 0, frame: 0, playing: false, yaw: 0.6, pitch: 0.25, zoom: 1, shown: [], last: 0 };

  function decode(text, Type) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    return new Type(bytes.buffer);
  }

  function load(name, data) {
    for (const motion of Object.values(data.motions)) {
      motion.clips = motion.positions.map((text) => decode(text, Int16Array));
      motion.feet = motion.contacts.map((text) => decode(text, Uint8Array));
    }
    loaded.set(name, data);
    if (waiting && waiting.table === name) { const wanted = waiting; waiting = null; open(wanted); }
  }

  function request(wanted) {
    waiting = wanted;
    if (loaded.has(wanted.table)) { waiting = null; open(wanted); return; }
    const script = document.createElement("script");
    script.src = `data/${encodeURIComponent(wanted.table)}.js`;
    script.onerror = () => { said.textContent = `The motions of ${wanted.table} are not beside this page.`; };
    document.body.append(script);
  }

  function open(wanted) {
    const data = loaded.get(wanted.table);
    state.table = wanted.table;
    tableMenu.value = wanted.table;
    rowBoxes.replaceChildren(document.createElement("legend"));
    rowBoxes.firstChild.textContent = "Bodies";
    const names = Object.keys(data.motions);
    const chosen = (wanted.rows || []).filter((name) => names.includes(name));
    state.shown = chosen.length ? chosen : names.slice(0, 5);
    for (const name of names) {
      const label = document.createElement("label");
      const box = document.createElement("input");
      box.type = "checkbox"; box.value = name; box.checked = state.shown.includes(name);
      box.addEventListener("change", () => {
        state.shown = [...rowBoxes.querySelectorAll("input:checked")].map((other) => other.value);
        fillOrder(); note(); draw();
      });
      label.append(box, ` ${data.motions[name].title}`);
      rowBoxes.append(label);
    }
    sampleMenu.replaceChildren(...data.samples.map((sample, place) => new Option(`${sample.id}: ${sample.said}`, place)));
    fillOrder();
    const place = data.samples.findIndex((sample) => sample.id === wanted.sample);
    choose(Math.max(place, 0), wanted.frame || 0);
  }

  function fillOrder() {
    const data = loaded.get(state.table), options = [new Option("best, median, worst …", "")];
    for (const name of state.shown) {
      for (const [metric, values] of Object.entries(data.motions[name].scores || {})) {
        const known = values.map((value, place) => ({ value, place })).filter((item) => item.value !== null);
        if (!known.length) continue;
        known.sort((a, b) => (data.better[metric] === "higher" ? b.value - a.value : a.value - b.value));
        const picks = { best: known[0], median: known[known.length >> 1], worst: known[known.length - 1] };
        for (const [word, pick] of Object.entries(picks))
          options.push(new Option(`${data.motions[name].title}, ${metric}: ${word} (${pick.value.toPrecision(3)})`, pick.place));
      }
    }
    orderMenu.replaceChildren(...options);
  }

  function choose(place, frame) {
    state.sample = place;
    sampleMenu.value = place;
    scrubber.max = frames() - 1;
    show(Math.min(frame, frames() - 1));
  }

  const clipOf = (name) => loaded.get(state.table).motions[name].clips[state.sample];
  const framesOf = (name) => Math.floor(clipOf(name).length / (3 * loaded.get(state.table).parents.length));
  const frames = () => Math.max(1, ...Object.keys(loaded.get(state.table).motions).filter((name) => name !== "style").map(framesOf));

  function show(frame) {
    state.frame = frame;
    scrubber.value = frame;
    note();
    draw();
  }

  function note() {
    const data = loaded.get(state.table), sample = data.samples[state.sample];
    said.textContent = `${sample.id}: ${sample.said}. Frame ${Math.floor(state.frame) + 1} of ${frames()}.`;
    const link = new URLSearchParams({ table: state.table, sample: sample.id, frame: String(Math.floor(state.frame)), rows: state.shown.join(",") });
    if (!state.playing) history.replaceState(null, "", `#${link}`);
  }

  function colours() {
    const style = getComputedStyle(document.documentElement);
    return Object.fromEntries(["ink", "faint", "left", "right", "middle", "contact"].map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }

  function draw() {
    const data = loaded.get(state.table);
    if (!data) return;
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = width * ratio; canvas.height = height * ratio;
    const pen = canvas.getContext("2d"), paint = colours();
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const cell = width / Math.max(state.shown.length, 1);
    state.shown.forEach((name, place) => body(pen, paint, data, name, place * cell, cell, height));
  }

  function body(pen, paint, data, name, left, width, height) {
    const clip = clipOf(name), n = data.parents.length, frame = Math.min(Math.floor(state.frame), framesOf(name) - 1);
    const scale = Math.min(width * 0.42, height * 0.4) * state.zoom;
    const base = frame * n * 3, ground = [clip[base] / 1000, clip[base + 2] / 1000];
    const [sy, cy, sp, cp] = [Math.sin(state.yaw), Math.cos(state.yaw), Math.sin(state.pitch), Math.cos(state.pitch)];
    const project = (x, y, z) => {
      const dx = x - ground[0], dz = z - ground[1];
      const across = cy * dx - sy * dz, deep = sy * dx + cy * dz;
      return [left + width / 2 + scale * across, height * 0.82 - scale * (cp * y - sp * deep)];
    };
    const joint = (index, at) => { const start = at * n * 3 + index * 3; return project(clip[start] / 1000, clip[start + 1] / 1000, clip[start + 2] / 1000); };
    const line = (from, to) => { pen.beginPath(); pen.moveTo(...from); pen.lineTo(...to); pen.stroke(); };
    pen.save();
    pen.beginPath(); pen.rect(left, 0, width, height); pen.clip();
    pen.strokeStyle = paint.faint; pen.lineWidth = 1;
    const [gx, gz] = ground.map((value) => Math.round(value * 2) / 2);
    for (let step = -2; step <= 2; step += 0.5) {
      line(project(gx + step, 0, gz - 2), project(gx + step, 0, gz + 2));
      line(project(gx - 2, 0, gz + step), project(gx + 2, 0, gz + step));
    }
    if (trailBox.checked) {
      for (const hand of data.hands) {
        pen.strokeStyle = data.sides[hand] === "left" ? paint.left : paint.right; pen.lineWidth = 1;
        for (let at = Math.max(1, frame - 25); at <= frame; at += 1) line(joint(hand, at - 1), joint(hand, at));
      }
    }
    pen.lineCap = "round"; pen.lineWidth = 3.5;
    data.parents.forEach((parent, index) => {
      if (parent < 0) return;
      pen.strokeStyle = paint[data.sides[index]];
      line(joint(parent, frame), joint(index, frame));
    });
    const [hx, hy] = joint(data.head, frame);
    pen.fillStyle = paint.middle; pen.beginPath(); pen.arc(hx, hy, scale * 0.06, 0, 7); pen.fill();
    pen.fillStyle = paint.contact;
    data.feet.forEach((foot, bit) => {
      if (!(data.motions[name].feet[state.sample][frame] & (1 << bit))) return;
      const [x, y] = joint(foot, frame);
      pen.beginPath(); pen.arc(x, y, 5, 0, 7); pen.fill();
    });
    pen.fillStyle = paint.ink; pen.font = "13px system-ui, sans-serif"; pen.textAlign = "center";
    pen.fillText(data.motions[name].title, left + width / 2, 18, width - 8);
    pen.restore();
  }

  function tick(now) {
    if (!state.playing) return;
    const passed = (now - state.last) / 1000;
    state.last = now;
    const next = state.frame + passed * loaded.get(state.table).fps * Number(speedMenu.value);
    show(next >= frames() ? 0 : next);
    requestAnimationFrame(tick);
  }

  function play(on) {
    if (!state.table) return;
    state.playing = on;
    playButton.textContent = on ? "Pause" : "Play";
    playButton.setAttribute("aria-pressed", String(on));
    if (on) { state.last = performance.now(); requestAnimationFrame(tick); } else { show(Math.floor(state.frame)); }
  }

  playButton.addEventListener("click", () => play(!state.playing));
  scrubber.addEventListener("input", () => {
    const wanted = Number(scrubber.value);
    play(false);
    show(wanted);
  });
  sampleMenu.addEventListener("change", () => choose(Number(sampleMenu.value), 0));
  tableMenu.addEventListener("change", () => request({ table: tableMenu.value }));
  orderMenu.addEventListener("change", () => { if (orderMenu.value !== "") choose(Number(orderMenu.value), 0); });
  trailBox.addEventListener("change", draw);
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    state.yaw += event.movementX * 0.01;
    state.pitch = Math.max(-0.2, Math.min(1.4, state.pitch + event.movementY * 0.01));
    draw();
  });
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(event.deltaY < 0 ? 1.1 : 1 / 1.1); }, { passive: false });
  const zoom = (factor) => { state.zoom = Math.max(0.3, Math.min(4, state.zoom * factor)); draw(); };
  const step = (by) => { play(false); show(Math.max(0, Math.min(frames() - 1, Math.floor(state.frame) + by))); };
  const keys = {
    " ": () => play(!state.playing), ArrowRight: () => step(1), ArrowLeft: () => step(-1),
    ArrowUp: () => choose(Math.max(0, state.sample - 1), 0), ArrowDown: () => choose(Math.min(loaded.get(state.table).samples.length - 1, state.sample + 1), 0),
    a: () => { state.yaw -= 0.15; draw(); }, d: () => { state.yaw += 0.15; draw(); }, "+": () => zoom(1.1), "-": () => zoom(1 / 1.1), Home: () => step(-Infinity), End: () => step(Infinity),
  };
  canvas.addEventListener("keydown", (event) => { if (state.table && keys[event.key]) { event.preventDefault(); keys[event.key](); } });
  window.addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);

  function follow() {
    const wanted = new URLSearchParams(location.hash.slice(1));
    if (state.table && !wanted.has("table")) return;
    const names = [...tableMenu.options].map((option) => option.value);
    const table = names.includes(wanted.get("table")) ? wanted.get("table") : names[0];
    if (table) request({ table, sample: wanted.get("sample"), frame: Number(wanted.get("frame")) || 0, rows: (wanted.get("rows") || "").split(",").filter(Boolean) });
  }
  window.addEventListener("hashchange", follow);
  // The data files call load(), so the first one may only be asked for once this object is there.
  queueMicrotask(follow);
  return { load, state };
})();
