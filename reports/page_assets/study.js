"use strict";
// Four bodies, one fixed camera, always playing; answers leave the page only as a file that the participant saves.
(() => {
  const { trials, questions, parents, sides, head, fps } = window.study;
  const stage = document.getElementById("stage"), form = document.getElementById("questions");
  const answers = new Map();
  let trial = 0, clips = [];

  const decode = (text) => new Int16Array(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);

  for (const [name, text] of Object.entries(questions)) {
    const group = document.createElement("fieldset"), legend = document.createElement("legend");
    legend.textContent = text;
    group.append(legend);
    for (const side of ["a", "b"]) {
      const label = document.createElement("label"), box = document.createElement("input");
      box.type = "radio"; box.name = name; box.value = side;
      box.addEventListener("change", () => { answers.set(`${trials[trial].id} ${name}`, side); note(); });
      label.append(box, ` ${side.toUpperCase()}`);
      group.append(label);
    }
    form.append(group);
  }

  function open(place) {
    trial = Math.max(0, Math.min(trials.length - 1, place));
    clips = Object.values(trials[trial].bodies).map((body) => ({ title: body.title, clip: decode(body.positions) }));
    for (const box of form.querySelectorAll("input")) box.checked = answers.get(`${trials[trial].id} ${box.name}`) === box.value;
    note();
  }

  function note() {
    const wanted = trials.length * Object.keys(questions).length;
    document.getElementById("place").textContent = `Pair ${trial + 1} of ${trials.length}; ${answers.size} of ${wanted} answers.`;
    document.getElementById("save").disabled = answers.size === 0;
  }

  function draw(now) {
    const ratio = window.devicePixelRatio || 1, width = stage.clientWidth, height = stage.clientHeight;
    stage.width = width * ratio; stage.height = height * ratio;
    const pen = stage.getContext("2d"), style = getComputedStyle(document.documentElement), cell = width / clips.length;
    const paint = (name) => style.getPropertyValue(`--${name}`).trim();
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    clips.forEach(({ title, clip }, place) => {
      const n = parents.length, frames = clip.length / (3 * n), frame = Math.floor((now / 1000) * fps) % frames, base = frame * n * 3;
      const scale = Math.min(cell * 0.42, height * 0.42);
      const at = (joint) => {
        const start = base + joint * 3, x = (clip[start] - clip[base]) / 1000, z = (clip[start + 2] - clip[base + 2]) / 1000;
        return [cell * (place + 0.5) + scale * (0.82 * x - 0.57 * z), height * 0.85 - scale * (clip[start + 1] / 1000 - 0.12 * (0.57 * x + 0.82 * z))];
      };
      pen.lineCap = "round"; pen.lineWidth = 3.5;
      parents.forEach((parent, joint) => {
        if (parent < 0) return;
        pen.strokeStyle = paint(sides[joint]);
        pen.beginPath(); pen.moveTo(...at(parent)); pen.lineTo(...at(joint)); pen.stroke();
      });
      pen.fillStyle = paint("middle"); pen.beginPath(); pen.arc(...at(head), scale * 0.06, 0, 7); pen.fill();
      pen.fillStyle = paint("ink"); pen.font = "14px system-ui, sans-serif"; pen.textAlign = "center";
      pen.fillText(title, cell * (place + 0.5), 20);
    });
    requestAnimationFrame(draw);
  }

  function save() {
    const field = document.getElementById("participant");
    if (!field.reportValidity()) return;
    const who = field.value.replace(/[",\r\n]/g, " ").trim();
    const lines = ["participant,trial,question,answer", ...[...answers].map(([asked, side]) => [who, ...asked.split(" "), side].join(","))];
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([`${lines.join("\n")}\n`], { type: "text/csv" }));
    link.download = `answers-${who}.csv`;
    link.click();
  }

  document.getElementById("back").addEventListener("click", () => open(trial - 1));
  document.getElementById("next").addEventListener("click", () => open(trial + 1));
  document.getElementById("save").addEventListener("click", save);
  open(0);
  requestAnimationFrame(draw);
})();
