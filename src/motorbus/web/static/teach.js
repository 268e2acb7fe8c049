// Teach: record axes that are moved by hand. Replay: play a recording.
import { html, number, useEffect, useState } from "./lib.js";
import { ask, link, order, say, send, useLink } from "./link.js";

export function Teach() {
  const { control, frame } = useLink();
  const free = Object.keys(link.machine.axes).filter((name) => {
    const axis = link.machine.axes[name];
    return axis.commands.includes("stream") && axis.commands.includes("disable_torque");
  });
  const [name, setName] = useState("recording-1");
  const [axes, setAxes] = useState(free);
  const [seconds, setSeconds] = useState(60);
  const [speed, setSpeed] = useState(1);
  const [repeat, setRepeat] = useState(1);
  const [recordings, setRecordings] = useState([]);
  const load = async () => setRecordings(await (await fetch("/recordings")).json());
  useEffect(() => { load(); }, []);
  const locked = control !== "you" || frame?.latched || frame?.activity;
  const teach = async () => {
    try {
      const made = await ask({ type: "teach", file: name, seconds, names: axes });
      say([`${made.name}: ${number(made.duration)} s recorded`, ...made.notes].join(" · "), made.notes.length > 0);
      load();
    } catch { /* shown already */ }
  };
  return html`
    <section class="card"><h2>Record</h2>
      <p class="bad">Torque of the chosen axes goes off: hold the arm.</p>
      <div class="row">${free.map((one) => html`<label><input type="checkbox" checked=${axes.includes(one)}
        onChange=${() => setAxes(axes.includes(one) ? axes.filter((other) => other !== one) : [...axes, one])} /> ${one}</label>`)}</div>
      <div class="row">
        <label>name <input type="text" size="14" value=${name} onInput=${(event) => setName(event.target.value)} /></label>
        <label>at most <input type="number" min="1" max="600" value=${seconds}
          onInput=${(event) => setSeconds(event.target.valueAsNumber)} /> s</label>
        ${frame?.activity === "teach"
          ? html`<button class="primary" onClick=${() => send({ type: "release" })}>Finish</button>`
          : html`<button disabled=${locked || !axes.length} onClick=${teach}>Record</button>`}
      </div></section>
    <section class="card"><h2>Replay</h2>
      <div class="row">
        <label>speed <input type="number" min="0.1" max="2" step="0.1" value=${speed}
          onInput=${(event) => setSpeed(event.target.valueAsNumber)} /> ×</label>
        <label>times <input type="number" min="1" max="100" value=${repeat}
          onInput=${(event) => setRepeat(event.target.valueAsNumber)} /></label></div>
      ${recordings.length === 0 && html`<p class="quiet">No recording yet.</p>`}
      ${recordings.map((one) => html`<div class="row"><span class="wide">${one}</span>
        <button disabled=${locked} onClick=${() => order({ type: "replay", file: one, speed, repeat })}>Replay</button></div>`)}
    </section>`;
}
