// The page: header with the stop, tabs, messages.
import { Axes } from "./axes.js";
import { Doctor } from "./doctor.js";
import { Faults } from "./faults.js";
import { html, render, useEffect, useState } from "./lib.js";
import { clearMessages, link, open, order, release, send, stop, useLink } from "./link.js";
import { Plot } from "./plot.js";
import { Registers } from "./registers.js";
import { Setup } from "./setup.js";
import { Teach } from "./teach.js";

const TOAST = 6000; // ms for which a new message is shown over the panel
const TABS = { Axes, Plot, Registers, Teach, Doctor, Setup, Faults };

function Header({ tab, setTab }) {
  const { machine, online, control, frame } = useLink();
  const simulated = Object.values(machine.buses).some((bus) => bus.simulated);
  const latched = frame?.latched;
  return html`
    <header>
      <h1>${machine.name || "motorbus"}</h1>
      ${simulated && html`<span class="badge">simulated</span>`}
      <span class=${online ? "badge good" : "badge bad"} data-testid="link">${online ? "live" : "no connection"}</span>
      <span class="space"></span>
      ${control === "you"
        ? html`<button onClick=${release} title="Stop, and let another page move the machine">Release</button>`
        : html`<button class="primary" disabled=${!online} onClick=${() => send({ type: "take", force: control === "other" })}>
            ${control === "other" ? "Take over" : "Take control"}</button>`}
      ${latched
        ? html`<button disabled=${control !== "you"} onClick=${() => order({ type: "reset" })}>Reset emergency stop</button>`
        : html`<button class="estop" onClick=${() => send({ type: "estop" })}
            title="Emergency stop of all buses, as the machine file says; latched">E-stop</button>`}
    </header>
    <button id="stop" onClick=${stop} title="Decelerate and hold (Esc, space)">STOP <kbd>Esc</kbd> <kbd>space</kbd></button>
    ${latched && html`<p class="alert" role="alert">Emergency stop: nothing moves until it is reset.</p>`}
    <nav role="tablist">
      ${Object.keys(tabs()).map((name) => html`
        <button role="tab" aria-selected=${name === tab} onClick=${() => setTab(name)}>${name}</button>`)}
      <span class="badge" data-testid="activity" hidden=${!frame?.activity}>${frame?.activity}</span>
    </nav>`;
}

/** The panels by name; without an axis those that set it up. */
function tabs() {
  const names = Object.keys(link.machine.axes).length ? Object.keys(TABS) : ["Setup", "Doctor", "Faults"];
  return Object.fromEntries(names.filter((name) => name !== "Faults" || link.demo).map((name) => [name, TABS[name]]));
}

function Messages() {
  const { messages } = useLink();
  const newest = messages[0];
  const young = newest && Date.now() - newest.at < TOAST;
  return html`
    ${young && html`<p class="toast ${newest.bad ? "bad" : ""}" aria-hidden="true">${newest.text}</p>`}
    <aside aria-live="polite" data-testid="messages">
      ${messages.length > 0 && html`<button class="small" onClick=${clearMessages}>clear</button>`}
      ${messages.map((one) => html`
        <p key=${one.id} class=${one.bad ? "bad" : ""}><time>${one.at.toLocaleTimeString()}</time> ${one.text}</p>`)}
    </aside>`;
}

function App() {
  const [tab, setTab] = useState(tabs()[location.hash.slice(1)] ? location.hash.slice(1) : Object.keys(tabs())[0]);
  useEffect(() => history.replaceState(null, "", `#${tab}`), [tab]);
  const Panel = tabs()[tab];
  return html`<${Header} tab=${tab} setTab=${setTab} /><main role="tabpanel"><${Panel} /></main><${Messages} />`;
}

/** Esc stops everywhere, space wherever it is not typed into a text. */
function onKey(event) {
  const types = event.target.matches?.("input[type=text], input[type=search], textarea");
  if (event.key === "Escape" || (event.key === " " && !types)) {
    event.preventDefault();
    if (!event.repeat) stop();
  }
}

addEventListener("keydown", onKey, { capture: true });
const root = document.getElementById("app");
try {
  await open();
  root.replaceChildren();
  render(html`<${App} />`, root);
} catch (error) {
  root.textContent = `The server does not answer: ${error.message}`;
}
