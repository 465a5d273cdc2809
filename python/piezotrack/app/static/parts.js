// Parts of a page as elements: one function for each kind, which makes it and brings it up to date.

import { Chart } from "./plot.js";

function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.includes("-") || name === "role") made.setAttribute(name, value);
    else made[name] = value;
  }
  made.append(...children);
  return made;
}

const lamp = (light) => element("span", { className: `lamp ${light}`, role: "img", "aria-label": light });

function button(item, send) {
  const made = element("button", { type: "button", textContent: item.label });
  if (item.primary) made.className = "primary";
  if (item.danger) made.className = "danger";
  if (item.disabled) made.disabled = true;
  if (item.pressed !== undefined) made.setAttribute("aria-pressed", item.pressed);
  made.onclick = () => send({ do: item.do, step: item.step, values: item.values, to: item.to });
  return made;
}

const heading = (part) => (part.title ? [element("h2", { textContent: part.title })] : []);

// Settings in the unit that is shown: `per` of these are one in SI.
const inside = (item, shown) => (item.per ? shown / item.per : shown);
const shown = (item, value) => Number(((item.per ?? 1) * value).toPrecision(6));

// A field of a number: as text, for browsers drop the comma of "1,5" from fields of numbers.
function numeral(change) {
  const field = element("input", { type: "text", inputMode: "decimal", className: "numeral", maxLength: 40 });
  field.onchange = () => {
    const words = field.value.trim().replace("\u2212", "-").replace(",", ".");
    const value = words === "" ? null : Number(words);
    if (Number.isFinite(value) || value === null) change(value);
    else faultIn(field.closest(".control"), `${field.value} is no number: expected one, as 1.5`);
  };
  return field;
}

function slider(item, change) {
  const STEPS = item.whole ? item.high - item.low : 1000;
  const log = item.scale === "log";
  const [low, high] = [item.low, item.high].map((v) => (log ? Math.log(v) : v));
  const place = (v) => Math.round(((log ? Math.log(v) : v) - low) / (high - low) * STEPS);
  const value = (k) => {
    const v = low + (k / STEPS) * (high - low);
    const digits = item.whole ? 9 : 3;
    return Number((log ? Math.exp(v) : v).toPrecision(digits));
  };
  const input = element("input", { type: "range", min: 0, max: STEPS, step: 1, value: place(item.value) });
  const field = numeral((value) => {
    if (value !== null) change(inside(item, value), false);
    else faultIn(field.closest(".control"), "expected a number; the value before is used");
  });
  field.value = shown(item, item.value);
  const unit = item.unit ?? "";
  const say = (v) => input.setAttribute("aria-valuetext", item.words?.[0] ? `${v}, from ${item.words[0]} to ${item.words[1]}` : `${shown(item, v)} ${unit}`);
  const send = (live) => {
    const v = value(Number(input.value));
    field.value = shown(item, v);
    say(v);
    change(item.per ? inside(item, Number(field.value)) : v, live);
  };
  say(item.value);
  input.setAttribute("aria-label", `${item.label}${unit ? `, ${unit}` : ""}`);
  input.oninput = () => send(true);
  input.onchange = () => send(false);
  field.setAttribute("aria-label", `${item.label} as a number${unit ? `, ${unit}` : ""}`);
  const ends = item.words ? [element("span", { textContent: `${item.words[0]} to ${item.words[1]}` })] : [];
  return element("div", { className: "control" }, element("span", { textContent: item.label }),
    element("div", { className: "row" }, input, ...(item.words ? [] : [field, unit])), ...ends);
}

function number(item, change) {
  const input = numeral((value) => change(value === null ? null : inside(item, value), false));
  if (item.value !== null) input.value = shown(item, item.value);
  if (item.placeholder) input.placeholder = item.placeholder;
  const label = `${item.label}${item.unit ? `, ${item.unit}` : ""}`;
  return element("label", { className: "control" }, label, input);
}

function select(item, change) {
  const input = element("select");
  item.options.forEach((one, i) => input.append(element("option", { value: i, textContent: one.text, selected: one.value === item.value })));
  input.onchange = () => change(item.options[Number(input.value)].value, false);
  if (item.missing) input.setAttribute("aria-invalid", "true");
  return element("label", { className: `control${item.missing ? " missing" : ""}` }, item.label, input);
}

function check(item, change) {
  const input = element("input", { type: "checkbox", checked: item.value });
  input.onchange = () => change(input.checked, false);
  return element("label", { className: "control check" }, input, item.label);
}

function entry(item, change) {
  const input = element("input", { type: "text", value: item.value ?? "", maxLength: 200 });
  input.onchange = () => change(input.value, false);
  return element("label", { className: "control" }, item.label, input);
}

function file(item, change, send) {
  const input = element("input", { type: "file" });
  input.onchange = () => input.files[0] && send({ do: "open", purpose: item.name, file: input.files[0] });
  const made = element("label", { className: "file" }, item.label, input);
  made.dataset.purpose = item.name;
  return made;
}

const KINDS = { slider, number, select, check, entry, file };

function controls(part, send) {
  const group = element("div", { className: "controls" });
  for (const item of part.items) {
    const change = (value, live) => {
      made.querySelector(".fault")?.remove();
      send({ do: "set", step: item.step ?? part.step, values: { [item.name]: value }, live });
    };
    const made = KINDS[item.type](item, change, send);
    made.dataset.name = item.name;
    group.append(made);
  }
  for (const one of part.buttons ?? []) group.append(button(one, send));
  if (!part.folded) return element("section", {}, ...heading(part), group);
  return element("details", {}, element("summary", { textContent: part.title }), group);
}

function messages(part, send) {
  const items = part.items.map((one) => element("div", { className: "message" }, lamp(one.level),
    element("span", { textContent: one.text }), ...one.fixes.map((fix) => button(fix, send))));
  return element("section", {}, ...heading(part), ...items);
}

function lights(part) {
  const items = part.items.map((one) => element("li", {}, element("strong", {}, lamp(one.light), one.name),
    element("p", { textContent: one.text })));
  return element("section", {}, ...heading(part), element("ul", { className: "lights" }, ...items));
}

function table(part) {
  const made = element("table");
  const head = made.createTHead().insertRow();
  for (const title of part.columns) head.append(element("th", { textContent: title }));
  const body = made.createTBody();
  for (const row of part.rows) {
    const line = body.insertRow();
    for (const text of row) line.insertCell().textContent = text;
  }
  return element("section", {}, ...heading(part), element("div", { className: "scroll" }, made));
}

function cards(part, send) {
  const items = part.items.map((one) => {
    const card = element("button", { type: "button", className: "card" },
      element("strong", {}, lamp(one.light), one.title), element("span", { className: "value", textContent: one.value }),
      element("small", { textContent: one.text }));
    if (one.share !== undefined) {
      const [fill, mark] = [element("i"), element("b")];
      fill.style.width = `${100 * one.share}%`;
      mark.style.left = `${100 * one.mark}%`;
      card.append(element("span", { className: "bar" }, fill, mark));
    }
    card.setAttribute("aria-pressed", String(Boolean(one.chosen)));
    card.disabled = !one.choose;
    card.onclick = () => send({ do: "set", step: part.step, values: one.choose });
    return card;
  });
  return element("section", {}, ...heading(part), element("div", { className: "cards" }, ...items),
    element("div", { className: "row" }, ...(part.buttons ?? []).map((one) => button(one, send))));
}

function code(part) {
  const copy = element("button", { type: "button", textContent: "Copy" });
  copy.onclick = async () => {
    await navigator.clipboard.writeText(part.text);
    copy.textContent = "Copied";
  };
  return element("details", { open: Boolean(part.open) }, element("summary", { textContent: part.title }),
    element("div", { className: "row" }, copy), element("pre", { textContent: part.text }));
}

function text(part) {
  return element("section", {}, ...heading(part), ...part.items.map((one) => element("p", { textContent: one })));
}

function buttons(part, send) {
  return element("div", { className: "row" }, ...part.items.map((one) => button(one, send)));
}

const MAKERS = { controls, messages, lights, table, cards, code, text, buttons };

// Parts that are shown, by key: their element, and the chart if it is one.
const present = new Map();

function focusOf(root) {
  const active = document.activeElement;
  if (!root.contains(active)) return null;
  return [...root.querySelectorAll("button, input, select, summary")].indexOf(active);
}

export function render(main, order, changed, send) {
  for (const key of [...present.keys()]) {
    if (order.includes(key)) continue;
    const old = present.get(key);
    old.chart?.remove();
    old.element.remove();
    present.delete(key);
  }
  for (const [key, part] of Object.entries(changed)) {
    const old = present.get(key);
    if (part.kind === "chart") {
      if (old) old.chart.update(part);
      else {
        const chart = new Chart(part, send);
        present.set(key, { element: chart.element, chart });
      }
      continue;
    }
    // What is dragged or typed in stays as it is.
    if (old && part.kind === "controls" && old.element.contains(document.activeElement)
        && ["range"].includes(document.activeElement.type) && old.shape === shape(part)) continue;
    const made = MAKERS[part.kind](part, send);
    made.dataset.part = key;
    if (old) {
      const focus = focusOf(old.element);
      if (old.element.tagName === "DETAILS") made.open = old.element.open;
      old.element.replaceWith(made);
      if (focus !== null && focus >= 0) made.querySelectorAll("button, input, select, summary")[focus]?.focus();
    }
    present.set(key, { element: made, shape: shape(part) });
  }
  let before = null;
  for (const key of order) {
    const { element: made } = present.get(key);
    const expected = before ? before.nextElementSibling : main.firstElementChild;
    if (expected !== made) before ? before.after(made) : main.prepend(made);
    before = made;
  }
  while (before && before.nextElementSibling) before.nextElementSibling.remove();
}

const shape = (part) => JSON.stringify(part.items?.map((one) => [one.name, one.low, one.high]));

function faultIn(control, words) {
  control.querySelector(".fault")?.remove();
  control.append(element("span", { className: "fault", role: "alert", textContent: words }));
}

// Beside the control whose value is refused, until it is changed.
export function faultAt(main, name, words) {
  if (!words || !name) return false;
  const control = [...main.querySelectorAll("[data-name]")].find((one) => one.dataset.name === name);
  if (!control) return false;
  // The value is in the field, in its unit.
  const short = words.replace(/^\w+ is \S+: (?=expected)/, "");
  faultIn(control, `${short}; the value before is used`);
  return true;
}
