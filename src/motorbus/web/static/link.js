// The socket to the server: the last state, the right to move, the results of commands.
import { useEffect, useState } from "./lib.js";

const BEAT = 150; // ms between two heartbeats
const RETAKE = 200; // ms until the control is taken again
const DRAW = 70; // ms between two drawings of the panels
const MESSAGES = 6;
const NOTES = 40;

export const link = {
  machine: null, // what /describe gave
  scales: {},
  demo: false,
  online: false,
  control: "none", // "you", "other" or "none"
  frame: null, // the last state
  messages: [],
  notes: [], // of a guided procedure
  step: null, // its question or live table
  report: null, // of the doctor
};
const frameListeners = new Set();
const drawListeners = new Set();
const waiting = []; // commands whose results are awaited
let socket = null;
let drawn = 0;
let releasing = false;
let reopened = false; // the server opens the machine again
let count = 0;

/** Load the description of the machine, then connect. */
export async function open() {
  const answer = await fetch("/describe");
  if (!answer.ok) throw new Error(await answer.text());
  const description = await answer.json();
  Object.assign(link, { machine: description.machine, scales: description.scales, demo: description.demo });
  description.warnings.forEach((text) => say(text, true));
  connect();
  setInterval(() => link.control === "you" && send({ type: "heartbeat" }), BEAT);
}

function connect() {
  socket = new WebSocket(`ws://${location.host}/ws`);
  socket.onopen = () => {
    if (reopened) location.reload();
    link.online = true;
    draw();
  };
  socket.onmessage = (event) => receive(JSON.parse(event.data));
  socket.onclose = () => {
    link.online = false;
    link.control = "none";
    waiting.splice(0).forEach((one) => one.fail({ text: "the connection was lost" }));
    draw();
    setTimeout(connect, 700);
  };
}

function receive(message) {
  switch (message.type) {
    case "state":
      link.frame = message;
      frameListeners.forEach((listener) => listener(message));
      if (performance.now() - drawn < DRAW) return;
      break;
    case "control":
      // A page that was too slow for a moment, while nothing moved, takes the control again.
      if (link.control === "you" && message.holder === "none" && !releasing && !link.frame?.activity) {
        setTimeout(() => link.control === "none" && send({ type: "take" }), RETAKE);
      }
      link.control = message.holder;
      releasing = false;
      break;
    case "done":
      take(message.of)?.finish(message.result);
      break;
    case "failed": {
      const parts = [message.text, message.expected && `expected: ${message.expected}`, message.cause];
      say([...parts, message.advice, ...(message.notes ?? [])].filter(Boolean).join(" · "), true);
      take(message.of)?.fail(message);
      break;
    }
    case "notice":
      say(message.text, false);
      reopened ||= message.reopens;
      break;
    case "note":
      link.notes = [...link.notes, message].slice(-NOTES);
      break;
    case "live":
    case "prompt":
      link.step = message;
  }
  draw();
}

function take(name) {
  const index = waiting.findIndex((one) => one.name === name);
  return index < 0 ? null : waiting.splice(index, 1)[0];
}

/** Give the control back; the machine stops. */
export function release() {
  releasing = true;
  send({ type: "leave" });
}

/** Show a text among the messages. */
export function say(text, bad) {
  link.messages = [{ id: ++count, text, bad, at: new Date() }, ...link.messages].slice(0, MESSAGES);
  draw();
}

/** Forget the messages. */
export function clearMessages() {
  link.messages = [];
  draw();
}

/** Send a message to the server; false without a connection. */
export function send(message) {
  if (socket?.readyState !== WebSocket.OPEN) return false;
  socket.send(JSON.stringify(message));
  return true;
}

/** Send a command and await its result; its error is shown and thrown. */
export function ask(message) {
  return new Promise((finish, fail) => {
    if (!send(message)) return fail({ text: "no connection" });
    waiting.push({ name: message.type, finish, fail });
  });
}

/** Send a command; its error is shown only. */
export function order(message) {
  ask(message).catch(() => {});
}

/** Stop all axes: decelerate and hold. */
export function stop() {
  if (!send({ type: "stop" })) say("NOT STOPPED: there is no connection to the server", true);
}

/** The number of stops so far, which targets must know. */
export function stops() {
  return link.frame?.stops ?? 0;
}

/** Call a function with each state; gives the function that ends it. */
export function onFrame(listener) {
  frameListeners.add(listener);
  return () => frameListeners.delete(listener);
}

/** Draw the panels again. */
export function draw() {
  drawn = performance.now();
  drawListeners.forEach((listener) => listener());
}

/** Draw this component with each change. */
export function useLink() {
  const [, set] = useState(0);
  useEffect(() => {
    const listener = () => set((before) => before + 1);
    drawListeners.add(listener);
    return () => drawListeners.delete(listener);
  }, []);
  return link;
}
