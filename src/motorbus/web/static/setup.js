// Set-up of a FEETECH bus, step by step: number its servos, calibrate its joints, verify them by hand.
import { html, Select, useState } from "./lib.js";
import { link, say, send, useLink } from "./link.js";

const KINDS = {
  number: {
    title: "Number the servos",
    text: "New servos all have the id 1. Connect one at a time; each gets the id of its joint and its settings. "
      + "Servos that have their ids already stay as they are.",
  },
  calibrate: {
    title: "Calibrate the joints",
    text: "Move each joint by hand from end to end. The middle of its travel becomes 0; the limits are written to "
      + "the servos and to the machine file, and the machine is opened again.",
  },
  verify: {
    title: "Verify by hand",
    text: "Move each joint by hand; the page says whether it is the right one and turns the right way. "
      + "Nothing is written.",
  },
};

function Live({ step }) {
  const columns = step.columns.length;
  return html`<table class="live"><thead><tr>${step.columns.map((column) => html`<th>${column}</th>`)}</tr></thead>
    <tbody>${step.rows.map((row) => html`
      <tr class=${row.mark ? "marked" : ""}><td>${row.name}</td>
        ${row.values.map((value) => html`<td class="number">${value}</td>`)}</tr>
      ${row.mark && html`<tr><td colspan=${columns}><small>${row.mark.replace(`${row.name} `, "")}</small></td></tr>`}`)}
    </tbody></table>`;
}

function Procedure({ kind, step, mine }) {
  const answer = (text) => send({ type: "answer", question: step.text, text });
  const choices = step?.type === "prompt" && step.choices.length ? step.choices : [""];
  return html`
    <section class="card question" role="dialog" aria-label=${KINDS[kind].title}>
      <h2>${KINDS[kind].title}</h2>
      ${step && html`<p class="lead">${step.text}</p>`}
      ${step?.type === "live" && html`<${Live} step=${step} />`}
      <div class="row">${step && choices.map((text, index) => html`
        <button class=${index ? "" : "primary"} disabled=${!mine} onClick=${() => answer(text)}>${text || "Enter ⏎"}</button>`)}
        <button disabled=${!mine} onClick=${() => send({ type: "release" })}>End</button></div>
      ${!mine && html`<p class="quiet">Another page answers; take the control to answer here.</p>`}
    </section>`;
}

export function Setup() {
  const { control, frame, step, notes } = useLink();
  const buses = Object.keys(link.machine.buses).filter((name) => link.machine.buses[name].family === "feetech");
  const [bus, setBus] = useState(buses[0]);
  const [left, setLeft] = useState([]); // joints that are left out
  if (!buses.length) return html`<p>This machine has no bus of FEETECH servos. Only these can be set up by hand.</p>`;
  const joints = Object.keys(link.machine.axes).filter((name) => link.machine.axes[name].device.startsWith(`${bus}#`));
  const running = KINDS[frame?.activity] && frame.activity;
  const begin = (kind) => {
    Object.assign(link, { step: null, notes: [] });
    const names = left.length ? joints.filter((name) => !left.includes(name)) : [];
    if (!send({ type: "setup", kind, bus, names })) say("no connection", true);
  };
  const toggle = (name) => setLeft(left.includes(name) ? left.filter((one) => one !== name) : [...left, name]);
  const locked = control !== "you" || frame?.latched || frame?.activity || (joints.length && left.length === joints.length);
  return html`
    ${running && html`<${Procedure} kind=${running} step=${step} mine=${control === "you"} />`}
    ${notes.length > 0 && html`<section class="card" data-testid="notes">
      ${notes.map((note) => html`<p class=${note.warning ? "bad" : ""}>${note.warning ? "⚠" : "✓"} ${note.text}</p>`)}</section>`}
    ${!running && html`
      <div class="row"><label>bus <${Select} label="bus" value=${bus} options=${buses} set=${setBus} /></label>
        ${joints.length > 1 && joints.map((name) => html`<label>
          <input type="checkbox" checked=${!left.includes(name)} onChange=${() => toggle(name)} /> ${name}</label>`)}</div>
      <p class="bad">Torque of all axes of the bus goes off: hold the arm.</p>
      ${Object.entries(KINDS).map(([kind, { title, text }], index) => html`<section class="card">
        <h2>${index + 1}. ${title}</h2><p>${text}</p>
        <button aria-label="begin ${kind}" disabled=${locked} onClick=${() => begin(kind)}>Begin</button></section>`)}
      ${!joints.length && html`<p>This bus has no axis yet: its joints are those of an SO-101. Calibrate writes the machine file.</p>`}`}`;
}
