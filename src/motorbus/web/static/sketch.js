// A sketch of the arm: its joints as lines, the goal as a ghost. Drag it to look from another side.
import { html, useEffect, useRef } from "./lib.js";
import { link, onFrame } from "./link.js";

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];

/** The numbers of a row: place (m), then roll, pitch, yaw (rad). */
function numbers(text) {
  const [place, turn = "0 0 0"] = text.replaceAll(/ mm| deg/g, "").split(", ");
  return {
    origin: place.split(" ").map((one) => one / 1000),
    turn: turn.split(" ").map((one) => one * Math.PI / 180),
  };
}

/** The axes that have a frame, each behind its parent. */
export function jointsOf({ axes }) {
  const found = [];
  const add = (name) => {
    const { parent, frame, tip, unit } = axes[name];
    if (!frame || found.some((one) => one.name === name)) return;
    if (parent in axes) add(parent);
    found.push({
      name, parent: found.findIndex((one) => one.name === parent), ...numbers(frame),
      tip: tip && numbers(tip), linear: unit === "mm" || unit === "m",
    });
  };
  Object.keys(axes).forEach(add);
  return found;
}

/** Product of two 3 x 4 matrices of rotation and translation. */
function multiply(a, b) {
  const result = [];
  for (let row = 0; row < 3; row++) {
    for (let column = 0; column < 4; column++) {
      let sum = column === 3 ? a[row * 4 + 3] : 0;
      for (let k = 0; k < 3; k++) sum += a[row * 4 + k] * b[k * 4 + column];
      result.push(sum);
    }
  }
  return result;
}

function translation([x, y, z]) {
  return [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z];
}

function rotation(axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  if (axis === "x") return [1, 0, 0, 0, 0, c, -s, 0, 0, s, c, 0];
  if (axis === "y") return [c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 0];
  return [c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, 0];
}

function place(parent, { origin, turn }) {
  const [roll, pitch, yaw] = turn;
  const turned = multiply(multiply(rotation("z", yaw), rotation("y", pitch)), rotation("x", roll));
  return multiply(multiply(parent, translation(origin)), turned);
}

/** Segments of these joints, as pairs of points (m), at these positions (rad, m). */
export function segments(joints, positions) {
  const frames = [];
  joints.forEach((joint, index) => {
    const at = positions[index] ?? 0;
    const moved = joint.linear ? translation([0, 0, at]) : rotation("z", at);
    frames.push(multiply(place(frames[joint.parent] ?? IDENTITY, joint), moved));
  });
  const point = (frame) => [frame[3], frame[7], frame[11]];
  const lines = joints.map((joint, index) => [
    joint.parent < 0 ? [...point(frames[index]).slice(0, 2), 0] : point(frames[joint.parent]), point(frames[index]),
  ]);
  joints.forEach((joint, index) => {
    if (joint.tip) lines.push([point(frames[index]), point(place(frames[index], joint.tip))]);
  });
  return lines;
}

/** The length (m) of all parts together. */
function lengthOf(joints) {
  const places = joints.flatMap((joint) => [joint.origin, joint.tip?.origin ?? [0, 0, 0]]);
  return places.reduce((sum, one) => sum + Math.hypot(...one), 0);
}

function draw(canvas, view, joints, positions, goals) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  context.lineCap = "round";
  const length = lengthOf(joints);
  const scale = Math.min(width / length, height / (0.75 * length));
  const project = ([x, y, z]) => {
    const across = x * Math.cos(view.yaw) - y * Math.sin(view.yaw);
    const depth = x * Math.sin(view.yaw) + y * Math.cos(view.yaw);
    const up = z * Math.cos(view.pitch) - depth * Math.sin(view.pitch);
    return [width / 2 + across * scale, height * 0.8 - up * scale];
  };
  const line = ([from, to], colour, thickness) => {
    context.strokeStyle = colour;
    context.lineWidth = thickness;
    context.beginPath();
    context.moveTo(...project(from));
    context.lineTo(...project(to));
    context.stroke();
  };
  for (let step = -3; step <= 3; step++) {
    const [at, far] = [step * length / 7, length * 3 / 7];
    line([[at, -far, 0], [at, far, 0]], "#8883", 1);
    line([[-far, at, 0], [far, at, 0]], "#8883", 1);
  }
  if (goals) segments(joints, goals).forEach((segment) => line(segment, "#4a90d966", 11));
  const lines = segments(joints, positions);
  lines.forEach((segment) => line(segment, "#e0792a", 9));
  context.fillStyle = "#fff";
  lines.slice(0, joints.length).forEach(([, to]) => {
    context.beginPath();
    context.arc(...project(to), 3, 0, 7);
    context.fill();
  });
}

export function Sketch() {
  const canvas = useRef(null);
  const joints = jointsOf(link.machine);
  useEffect(() => {
    if (!joints.length) return undefined;
    const view = { yaw: -0.9, pitch: -0.35 };
    const show = () => {
      const axes = link.frame?.state.axes;
      if (!axes) return;
      const here = joints.map(({ name }) => axes[name]?.position ?? 0);
      const goals = joints.map(({ name }, index) => axes[name]?.target ?? here[index]);
      draw(canvas.current, view, joints, here, goals.some((goal, index) => goal !== here[index]) ? goals : null);
    };
    const turn = (event) => {
      if (!event.buttons) return;
      view.yaw += event.movementX / 120;
      view.pitch = Math.max(-1.5, Math.min(0.2, view.pitch - event.movementY / 120));
      show();
    };
    let waits = false;
    const end = onFrame(() => {
      if (waits) return;
      waits = true;
      requestAnimationFrame(() => { waits = false; if (canvas.current) show(); });
    });
    canvas.current.addEventListener("pointermove", turn);
    show();
    return end;
  }, []);
  return joints.length > 0 && html`<canvas class="sketch" ref=${canvas} role="img" data-testid="sketch"
    aria-label="sketch of the arm; the goal is a ghost"></canvas>`;
}
