// Faults of the simulated buses of the demo.
import { html, Select, useState } from "./lib.js";
import { ask, link, say } from "./link.js";

const DEVICE = ["unplug", "plug", "power-cycle", "block", "release", "push 30deg", "push -30deg", "load 60%", "supply 12", "heat 72"];
const WIRE = ["1%: corrupt", "5%: drop", "5%: delay 0.02", "2%: duplicate", "off"];

export function Faults() {
  const names = Object.keys(link.machine.axes);
  const buses = Object.keys(link.machine.buses);
  const [axis, setAxis] = useState(names[0]);
  const [bus, setBus] = useState(buses[0]);
  const [script, setScript] = useState("");
  const inject = (where, text) => ask({ type: "inject", bus: where, order: text })
    .then(() => say(`${where}: ${text}`, false), () => {});
  const toDevice = (text) => {
    const [where, id] = link.machine.axes[axis].device.split("#");
    const [word, ...rest] = text.split(" ");
    inject(where, [word, id, ...rest].join(" "));
  };
  return html`
    <section class="card"><h2>A device</h2>
      <div class="row"><${Select} label="axis" value=${axis} options=${names} set=${setAxis} />
        ${DEVICE.map((text) => html`<button onClick=${() => toDevice(text)}>${text}</button>`)}</div></section>
    <section class="card"><h2>The wire</h2>
      <div class="row"><${Select} label="bus" value=${bus} options=${buses} set=${setBus} />
        ${WIRE.map((text) => html`<button onClick=${() => inject(bus, `faults ${text}`)}>${text}</button>`)}</div>
      <form class="row" onSubmit=${(event) => { event.preventDefault(); inject(bus, `faults ${script}`); }}>
        <input type="text" class="wide" aria-label="fault script" placeholder="at 2.5 s: unplug 0.5" value=${script}
          onInput=${(event) => setScript(event.target.value)} /><button>Set</button></form></section>`;
}
