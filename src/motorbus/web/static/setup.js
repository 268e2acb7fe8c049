// Set-up: verify names and directions of the axes by moving each by hand.
import { html, useState } from "./lib.js";
import { ask, link, order, send, useLink } from "./link.js";

function Table({ step }) {
  return html`<table><thead><tr>${step.columns.map((column) => html`<th>${column}</th>`)}<th></th></tr></thead>
    <tbody>${step.rows.map((row) => html`<tr class=${row.mark ? "marked" : ""}><td>${row.name}</td>
      ${row.values.map((value) => html`<td class="number">${value}</td>`)}<td>${row.mark}</td></tr>`)}</tbody></table>`;
}

export function Setup() {
  const { control, frame, step, notes } = useLink();
  const buses = Object.keys(link.machine.buses).filter((name) => link.machine.buses[name].family === "feetech");
  const [bus, setBus] = useState(buses[0]);
  const running = frame?.activity === "verify";
  const begin = async () => {
    Object.assign(link, { step: null, notes: [] });
    await ask({ type: "verify", bus }).catch(() => {});
    link.step = null;
  };
  if (!buses.length) return html`<p>No bus of FEETECH servos is in this machine.</p>`;
  return html`
    <section class="card"><h2>Verify by hand</h2>
      <p>Each axis is moved by hand; the page says whether it is the right one and turns the right way.
        Nothing is written. <span class="bad">Torque of all axes of the bus goes off: hold the arm.</span></p>
      <div class="row"><select aria-label="bus" value=${bus} onChange=${(event) => setBus(event.target.value)}>
        ${buses.map((name) => html`<option>${name}</option>`)}</select>
        <button disabled=${running || control !== "you" || frame?.activity} onClick=${begin}>Begin</button></div>
      ${running && step && html`<p><b>${step.text}</b></p>
        ${step.type === "live" && html`<${Table} step=${step} />`}
        <div class="row"><button class="primary" onClick=${() => send({ type: "answer" })}>Pass over</button>
          <button onClick=${() => order({ type: "stop" })}>End</button></div>`}
      <div data-testid="notes">${notes.map((note) => html`<p class=${note.warning ? "bad" : ""}>${note.text}</p>`)}</div>
    </section>
    <p class="quiet">New servos get their ids, and an arm its calibration, by <code>motorbus setup</code> in a shell.</p>`;
}
