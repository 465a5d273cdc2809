// The window: its connection to the server, the rail of steps, files, undo and keys.

import { faultAt, render } from "./parts.js";
import { redraw } from "./plot.js";

const LARGEST = 64 * 2 ** 20;
const $ = (id) => document.getElementById(id);
const main = $("page");
const fragment = new URLSearchParams(location.hash.slice(1));
const token = fragment.get("token") ?? "";
let socket, step, download, taken = "", retry = 0, sent = 0;
// Of what is dragged, one message is on its way and the latest one waits.
let busy = null, waiting = null;
const begun = new Map();

function windowName() {
  let name = sessionStorage.getItem("window");
  if (!name) {
    name = Array.from(crypto.getRandomValues(new Uint8Array(16)), (b) => b.toString(16).padStart(2, "0")).join("");
    sessionStorage.setItem("window", name);
  }
  return name;
}

function connect() {
  socket = new WebSocket(`ws://${location.host}/socket`);
  socket.binaryType = "blob";
  socket.onopen = () => {
    const width = Math.round(main.clientWidth * (window.devicePixelRatio || 1)) || 800;
    socket.send(JSON.stringify({ token, window: windowName(), width, state: fragment.get("state") }));
  };
  socket.onmessage = ({ data }) => (typeof data === "string" ? receive(JSON.parse(data)) : save(data));
  socket.onclose = closed;
}

function closed({ code, reason }) {
  busy = waiting = null;
  if (code === 4010 || code === 4008 || code === 4003 || code === 1009) {
    say(code === 4003 ? `${reason}: open the address that piezotrack app printed` : reason, true);
    return;
  }
  retry += 1;
  if (retry > 3) say("The program has ended. Start it again with: piezotrack app", true);
  else setTimeout(connect, 400 * retry);
}

function send(given) {
  if (given.do === "open") {
    upload(given);
    return;
  }
  if (socket.readyState !== WebSocket.OPEN) {
    say("The program has ended. Start it again with: piezotrack app", true);
    return;
  }
  if (given.live && busy !== null) {
    waiting = given;
    return;
  }
  if (!given.live) waiting = null;
  sent += 1;
  if (given.live) busy = sent;
  begun.set(sent, performance.now());
  socket.send(JSON.stringify({ ...given, seq: sent }));
}

function upload({ purpose, file }) {
  if (file.size > LARGEST) {
    say(`${file.name} has ${(file.size / 2 ** 20).toFixed(0)} MB: expected 64 MB at most`);
    return;
  }
  const kind = file.name.endsWith(".piezotrack.json") ? "state" : purpose;
  socket.send(JSON.stringify({ do: "open", purpose: kind, name: file.name }));
  socket.send(file);
}

function save(blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = download ?? "piezotrack";
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

function receive(answer) {
  retry = 0;
  if (answer.download) download = answer.download;
  const turned = step !== answer.step;
  step = answer.step;
  rail(answer.rail);
  render(main, answer.order, answer.changed, send);
  if (turned) {
    document.title = `${answer.rail.find((one) => one.step === step).title}: piezotrack`;
    window.scrollTo(0, 0);
  }
  $("undo").disabled = !answer.undo;
  $("redo").disabled = !answer.redo;
  $("stop").hidden = !answer.running;
  $("halt").hidden = !answer.device;
  if (answer.download) {
    taken = `saved: ${answer.download}`;
    setTimeout(() => {
      if ($("running").textContent === taken) $("running").textContent = "";
      taken = "";
    }, 5000);
  }
  const ends = answer.stopping ? `stopping: ${answer.stopping}` : taken;
  $("running").textContent = answer.running ? `computing: ${answer.running}` : ends;
  const fault = answer.error;
  if (answer.seq || fault) say(fault && !faultAt(main, fault.control, fault.text) ? fault.text : "");
  keep(answer.link);
  if (begun.has(answer.seq)) {
    performance.measure("answer", { start: begun.get(answer.seq), end: performance.now() });
    begun.delete(answer.seq);
  }
  // The server answers the latest of several: those before it have no answer.
  if (busy !== null && answer.seq >= busy) {
    busy = null;
    if (waiting) {
      const next = waiting;
      waiting = null;
      send(next);
    }
  }
}

// Browsers take a new address a few times a second only.
let keeping;
function keep(link) {
  clearTimeout(keeping);
  keeping = setTimeout(() => history.replaceState(null, "", `#token=${token}&state=${link}`), 200);
}

function rail(steps) {
  const list = $("rail");
  if (!list.children.length) {
    steps.forEach((one, i) => {
      const button = document.createElement("button");
      button.innerHTML = '<span class="lamp" role="img"></span><span class="name"></span><small></small>';
      button.onclick = () => send({ do: "go", to: one.step });
      button.setAttribute("aria-keyshortcuts", String(i + 1));
      const item = document.createElement("li");
      item.append(button);
      list.append(item);
    });
  }
  steps.forEach((one, i) => {
    const button = list.children[i].firstElementChild;
    const [lamp, name, words] = button.children;
    lamp.className = `lamp ${one.light}`;
    lamp.setAttribute("aria-label", one.light);
    name.textContent = `${i + 1} ${one.title}`;
    words.textContent = one.text;
    if (one.step !== step) button.removeAttribute("aria-current");
    else if (!button.hasAttribute("aria-current")) {
      button.setAttribute("aria-current", "step");
      // On a phone the rail is a row that is wider than the screen.
      button.scrollIntoView({ block: "nearest", inline: "nearest" });
    }
  });
}

function say(words, lasting = false) {
  const place = $("error");
  if (place.dataset.lasting && !lasting) return;
  place.textContent = words;
  place.hidden = !words;
  if (lasting) place.dataset.lasting = "yes";
}

function theme(name) {
  document.documentElement.dataset.theme = name;
  $("theme").textContent = name === "dark" ? "Light" : "Dark";
  localStorage.setItem("theme", name);
  redraw();
}

$("undo").onclick = () => send({ do: "undo" });
$("redo").onclick = () => send({ do: "redo" });
$("stop").onclick = () => send({ do: "stop" });
$("halt").onclick = () => send({ do: "halt" });
$("keys").onclick = () => $("help").showModal();
$("theme").onclick = () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
$("error").onclick = () => ($("error").hidden = true);

document.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !$("halt").hidden) send({ do: "halt" });
  const typing = event.target.matches("input[type=text], select, textarea");
  const key = event.key.toLowerCase();
  if ((event.ctrlKey || event.metaKey) && (key === "z" || key === "y")) {
    if (typing) return;
    event.preventDefault();
    send({ do: key === "y" || event.shiftKey ? "redo" : "undo" });
  } else if (!typing && !event.ctrlKey && !event.metaKey && !event.altKey) {
    if (key === "?") $("help").showModal();
    else if (key === "s") send({ do: "stop" });
    else if (key >= "1" && key <= "5") $("rail").children[Number(key) - 1]?.firstElementChild.click();
  }
});

let dropping;
document.addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("dropping");
  clearTimeout(dropping);
  dropping = setTimeout(() => document.body.classList.remove("dropping"), 300);
});
document.addEventListener("drop", (event) => {
  event.preventDefault();
  const file = event.dataTransfer.files[0];
  if (!file) return;
  const place = event.target.closest?.("[data-purpose]") ?? main.querySelector("[data-purpose]");
  upload({ purpose: place?.dataset.purpose ?? "log", file });
});

let resized;
window.addEventListener("resize", () => {
  clearTimeout(resized);
  const width = () => Math.round(main.clientWidth * (window.devicePixelRatio || 1));
  resized = setTimeout(() => send({ do: "size", width: width() }), 250);
});

const dark = window.matchMedia("(prefers-color-scheme: dark)").matches;
theme(localStorage.getItem("theme") ?? (dark ? "dark" : "light"));
connect();
