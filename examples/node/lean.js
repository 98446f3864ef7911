// A method in plain Node.js: it speaks the protocol itself and reads and writes .bvh files.
// Its "style": however the reference looks, the spine leans forward by 20 degrees.
"use strict";
const fs = require("fs");
const path = require("path");
const readline = require("readline");

const LEAN_DEGREES = 20;
let exchange = "";

// stdout belongs to the protocol, one JSON object a line. Everything else goes to stderr.
const send = (message) => process.stdout.write(JSON.stringify(message) + "\n");

const calls = {
  hello(request) {
    exchange = request.exchange;
    return { protocol: 1, capabilities: ["transfers"], fits: false, program: "node " + process.version };
  },
  transfer(request) {
    return {
      files: request.tasks.map((task) => {
        const text = fs.readFileSync(path.join(exchange, task.content.file), "utf8");
        const name = task.answer + ".bvh";
        fs.writeFileSync(path.join(exchange, name), leaning(text));
        return name;
      }),
    };
  },
};

// The columns of a .bvh file are the channels of its joints in file order.
function columnOf(header, joint, channel) {
  let column = 0;
  let current = "";
  for (const line of header.split("\n")) {
    const words = line.trim().split(/\s+/);
    if (words[0] === "ROOT" || words[0] === "JOINT") current = words[1];
    if (words[0] !== "CHANNELS") continue;
    const place = words.indexOf(channel);
    if (current === joint && place >= 0) return column + place - 2;
    column += Number(words[1]);
  }
  throw new Error(`no ${channel} of ${joint}`);
}

function leaning(text) {
  const lines = text.split("\n");
  const first = lines.findIndex((line) => line.startsWith("Frame Time")) + 1;
  const column = columnOf(lines.slice(0, first).join("\n"), "Spine", "Xrotation");
  const rows = lines.slice(first).map((line) => {
    const values = line.trim().split(/\s+/);
    if (values.length <= column) return line;
    values[column] = (Number(values[column]) + LEAN_DEGREES).toFixed(6);
    return values.join(" ");
  });
  return lines.slice(0, first).concat(rows).join("\n");
}

readline.createInterface({ input: process.stdin }).on("line", (line) => {
  const request = JSON.parse(line);
  if (request.call === "stop") process.exit(0);
  if (request.call === "cancel") return; // answers are quick here; there is nothing to stop
  try {
    send({ id: request.id, ok: true, ...calls[request.call](request) });
  } catch (error) {
    console.error(error);
    send({ id: request.id, ok: false, error: { type: error.name, text: error.message } });
  }
}).on("close", () => process.exit(0));
