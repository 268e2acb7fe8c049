// The doctor: findings about the open machine, the first cause first; and the health of each device.
import { html, number } from "./lib.js";
import { ask, draw, link, useLink } from "./link.js";

const PARTS = [["measured", "evidence"], ["why", "cause"], ["fix", "action"], ["because of", "because"]];
const COLUMNS = [
  ["V", "voltage", 1], ["A", "current", 2], ["°C", "temperature", 0],
  ["lost %", "lost", 1], ["p50 ms", "p50", 1], ["p99 ms", "p99", 1],
];
const SIGNS = { error: "✖", warning: "⚠", info: "ℹ" };

/** Text whose commands in backticks are set as code. */
function marked(text) {
  return text.split("`").map((part, index) => (index % 2 ? html`<code>${part}</code>` : part));
}

function Finding({ one }) {
  return html`<article class="card finding ${one.severity}" data-testid="finding-${one.code}">
    <h2><span class="sign">${SIGNS[one.severity]} ${one.severity}</span> ${one.code} <small>${one.where}</small></h2>
    <dl>${PARTS.filter(([, key]) => one[key]).map(([title, key]) => html`
      <dt>${title}</dt><dd>${marked(one[key])}</dd>`)}</dl></article>`;
}

function Devices({ devices }) {
  return html`<section class="card"><h2>Devices</h2><div class="scroll"><table>
    <thead><tr><th>axis</th><th>model</th><th>firmware</th>${COLUMNS.map(([title]) => html`<th class="number">${title}</th>`)}</tr></thead>
    <tbody>${Object.entries(devices).map(([name, one]) => html`<tr><td>${name}</td><td>${one.model}</td><td>${one.firmware}</td>
      ${COLUMNS.map(([, key, digits]) => html`<td class="number">${number(one[key], digits)}</td>`)}</tr>`)}</tbody>
  </table></div></section>`;
}

function summary({ findings, devices }) {
  const counts = ["error", "warning"].map((word) => [findings.filter((one) => one.severity === word).length, word]);
  const texts = counts.filter(([count]) => count).map(([count, word]) => `${count} ${word}${count > 1 ? "s" : ""}`);
  return [...(texts.length ? texts : ["nothing wrong found"]), `${Object.keys(devices).length} devices answer`].join(", ");
}

export function Doctor() {
  const { control, frame, report } = useLink();
  const running = frame?.activity === "doctor";
  const busy = frame?.activity && frame.activity !== "follow";
  const examine = async () => {
    try {
      link.report = { ...(await ask({ type: "doctor" })), made: new Date() };
    } catch { /* shown already */ }
    draw();
  };
  return html`
    <div class="row bar"><button class="primary" disabled=${control !== "you" || busy} onClick=${examine}>
      ${running ? "Examining …" : "Examine"}</button>
      <span class="quiet">${running
        ? "Every device is read; no axis can be moved until the end. STOP ends it."
        : "Finds out what is wrong. It waits until all axes rest and only reads: nothing is written to a device."}</span></div>
    ${report && html`
      <p data-testid="summary"><b>${summary(report)}</b> <small>${report.made.toLocaleTimeString()}${report.simulated ? ", simulated" : ""}</small></p>
      ${report.findings.map((one) => html`<${Finding} key=${one.code + one.where} one=${one} />`)}
      ${Object.keys(report.devices).length > 0 && html`<${Devices} devices=${report.devices} />`}`}`;
}
