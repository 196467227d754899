/* The box in three dimensions: estimate and reference, to play, scrub and turn. World axes are
   east, north, up; the quaternions that arrive take the body's axes to north, east, down. */
(function () {
  "use strict";
  const COLORS = ["#d55e00", "#009e73", "#0072b2"];
  const HALF = [0.62, 0.42, 0.11]; // half the box's edges along x, y, z
  const ARROW = [1.2, 1.0, 0.85];
  const FACES = [ // axis, side, colour
    [0, 1, [214, 226, 238]], [0, -1, [190, 203, 217]],
    [1, 1, [202, 215, 229]], [1, -1, [196, 209, 223]],
    [2, 1, [236, 242, 248]], [2, -1, [150, 164, 180]],
  ];
  const DEG = 180 / Math.PI;

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const floats = (text) => new Float32Array(bytes(text).buffer);
  const doubles = (text) => new Float64Array(bytes(text).buffer);

  /* body vector to east, north, up */
  function turn(q, v) {
    const [w, x, y, z] = q;
    const tx = 2 * (y * v[2] - z * v[1]);
    const ty = 2 * (z * v[0] - x * v[2]);
    const tz = 2 * (x * v[1] - y * v[0]);
    const n = v[0] + w * tx + y * tz - z * ty;
    const e = v[1] + w * ty + z * tx - x * tz;
    const d = v[2] + w * tz + x * ty - y * tx;
    return [e, n, -d];
  }

  function rollPitchYaw(q) {
    const [w, x, y, z] = q;
    return [
      Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
      Math.asin(Math.max(-1, Math.min(1, 2 * (w * y - x * z)))),
      Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    ].map((angle) => angle * DEG);
  }

  function angleBetween(a, b) {
    const w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    const x = -a[0] * b[1] + a[1] * b[0] - a[2] * b[3] + a[3] * b[2];
    const y = -a[0] * b[2] + a[1] * b[3] + a[2] * b[0] - a[3] * b[1];
    const z = -a[0] * b[3] - a[1] * b[2] + a[2] * b[1] + a[3] * b[0];
    return 2 * Math.atan2(Math.hypot(x, y, z), Math.abs(w)) * DEG;
  }

  function start(root) {
    const data = JSON.parse(root.querySelector("script").textContent);
    const t = doubles(data.t);
    const known = bytes(data.known); // bit 1: estimate, bit 2: reference
    const estimate = floats(data.estimate);
    const reference = data.reference ? floats(data.reference) : null;
    const canvas = root.querySelector("canvas");
    const context = canvas.getContext("2d");
    const slider = root.querySelector("input[type=range]");
    const play = root.querySelector(".play");
    const speed = root.querySelector("select");
    const cells = (name) => Array.from(root.querySelectorAll(`[data-row=${name}]`));
    const state = root.querySelector(".state");
    const first = t[0];
    const last = t[t.length - 1];
    let azimuth = 152 / DEG; // of the viewer, seen from the box
    let elevation = 24 / DEG;
    let now = first;
    let running = false;
    let stamp = null;

    function at(series, row, part) {
      const a = series.subarray(4 * row, 4 * row + 4);
      if (part === 0) return a;
      const b = series.subarray(4 * row + 4, 4 * row + 8);
      const side = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0 ? -1 : 1;
      const q = [0, 1, 2, 3].map((i) => (1 - part) * a[i] + part * side * b[i]);
      const norm = Math.hypot(...q);
      return q.map((c) => c / norm);
    }

    /* the attitudes at a time; null where there is none */
    function moment(time) {
      let low = 0;
      let high = t.length - 1;
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (t[middle] <= time) low = middle; else high = middle;
      }
      if (time >= t[high]) low = high;
      const step = low + 1 < t.length ? t[low + 1] - t[low] : 0;
      const pair = low + 1 < t.length ? known[low] & known[low + 1] : 0;
      const gap = step > data.gap_s;
      const part = step > 0 && !gap ? (time - t[low]) / step : 0;
      const take = (series, bit) =>
        known[low] & bit ? at(series, low, pair & bit ? part : 0) : null;
      return {
        gap: gap && time > t[low],
        estimate: take(estimate, 1),
        reference: reference ? take(reference, 2) : null,
      };
    }

    function render() {
      const ratio = window.devicePixelRatio || 1;
      const width = canvas.clientWidth;
      const height = canvas.clientHeight;
      if (canvas.width !== Math.round(width * ratio)) {
        canvas.width = Math.round(width * ratio);
        canvas.height = Math.round(height * ratio);
      }
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.clearRect(0, 0, width, height);
      context.lineCap = context.lineJoin = "round";
      const sa = Math.sin(azimuth);
      const ca = Math.cos(azimuth);
      const se = Math.sin(elevation);
      const ce = Math.cos(elevation);
      const scale = Math.min(width, height * 1.5) * 0.225;

      /* east, north, up to pixels, and how near */
      function project(p) {
        const right = -ca * p[0] + sa * p[1];
        const up = -sa * se * p[0] - ca * se * p[1] + ce * p[2];
        const near = sa * ce * p[0] + ca * ce * p[1] + se * p[2];
        const k = (scale * 6) / (6 - near);
        return [width / 2 + k * right, height * 0.37 - k * up, near];
      }

      function stroke(points, color, line, dash, close) {
        context.beginPath();
        points.forEach((p, i) => {
          const [px, py] = project(p);
          if (i) context.lineTo(px, py); else context.moveTo(px, py);
        });
        if (close) context.closePath();
        context.setLineDash(dash || []);
        context.strokeStyle = color;
        context.lineWidth = line;
        context.stroke();
        context.setLineDash([]);
      }

      function label(text, p, color, size) {
        const [px, py] = project(p);
        context.font = `600 ${size}px system-ui, sans-serif`;
        context.textAlign = "center";
        context.textBaseline = "middle";
        context.fillStyle = color;
        context.fillText(text, px, py);
      }

      function compass() {
        const ground = -1.05;
        const ring = (radius) => Array.from({ length: 73 }, (_, i) => {
          const a = (i * 5) / DEG;
          return [radius * Math.sin(a), radius * Math.cos(a), ground];
        });
        stroke(ring(1.35), "#b9c4cf", 1.2);
        stroke(ring(0.7), "#d3dbe3", 1);
        for (let i = 0; i < 36; i += 1) {
          const a = (i * 10) / DEG;
          const inner = i % 9 === 0 ? 0 : i % 3 === 0 ? 1.25 : 1.3;
          const radial = (r) => [r * Math.sin(a), r * Math.cos(a), ground];
          stroke([radial(inner), radial(1.35)], i % 9 === 0 ? "#c3cdd7" : "#b9c4cf", 1);
        }
        ["N", "E", "S", "W"].forEach((name, i) => {
          const a = (i * 90) / DEG;
          const p = [1.53 * Math.sin(a), 1.53 * Math.cos(a), ground];
          label(name, p, name === "N" ? "#1d232b" : "#76828f", name === "N" ? 15 : 12);
        });
      }

      function arrow(q, axis, color, line, dash) {
        const tip = [0, 0, 0];
        tip[axis] = ARROW[axis];
        const from = [0, 0, 0];
        from[axis] = dash ? 0 : HALF[axis];
        const end = turn(q, tip);
        stroke([turn(q, from), end], color, line, dash);
        if (dash) return;
        const [px, py] = project(end);
        const [ox, oy] = project(turn(q, from));
        const length = Math.hypot(px - ox, py - oy);
        if (length > 4) {
          const ux = (px - ox) / length;
          const uy = (py - oy) / length;
          context.beginPath();
          context.moveTo(px + 9 * ux, py + 9 * uy);
          context.lineTo(px - 4 * ux + 5 * uy, py - 4 * uy - 5 * ux);
          context.lineTo(px - 4 * ux - 5 * uy, py - 4 * uy + 5 * ux);
          context.fillStyle = color;
          context.fill();
        }
        tip[axis] += 0.2;
        label("xyz"[axis], turn(q, tip), color, 15);
      }

      function corners(axis, side) {
        const [i, j] = [0, 1, 2].filter((k) => k !== axis);
        return [[1, 1], [1, -1], [-1, -1], [-1, 1]].map(([a, b]) => {
          const p = [0, 0, 0];
          p[axis] = side * HALF[axis];
          p[i] = a * HALF[i];
          p[j] = b * HALF[j];
          return p;
        });
      }

      function ghost(q) {
        [1, -1].forEach((side) =>
          stroke(corners(2, side).map((p) => turn(q, p)), "#7d8794", 1.2, [5, 4], true));
        corners(2, 1).forEach((p) => stroke(
          [turn(q, p), turn(q, [p[0], p[1], -p[2]])], "#7d8794", 1.2, [5, 4]));
        [0, 1, 2].forEach((axis) => arrow(q, axis, COLORS[axis], 1.6, [4, 4]));
      }

      function box(q) {
        const eye = [sa * ce * 6, ca * ce * 6, se * 6];
        const faces = FACES.map(([axis, side, color]) => {
          const normal = [0, 0, 0];
          normal[axis] = side;
          const n = turn(q, normal);
          const toEye = eye.map((e, k) => e - n[k] * HALF[axis]);
          const facing = n[0] * toEye[0] + n[1] * toEye[1] + n[2] * toEye[2];
          return { axis, side, color, n, facing };
        });
        const hidden = (axis) => faces.some((f) => f.axis === axis && f.side === 1 && f.facing <= 0);
        const axes = [0, 1, 2];
        axes.filter(hidden).forEach((axis) => arrow(q, axis, COLORS[axis], 3.2));
        faces.filter((face) => face.facing > 0).forEach((face) => {
          const light = 0.86 + 0.14 * (0.35 * face.n[0] - 0.25 * face.n[1] + 0.9 * face.n[2]);
          context.beginPath();
          corners(face.axis, face.side).forEach((p, i) => {
            const [px, py] = project(turn(q, p));
            if (i) context.lineTo(px, py); else context.moveTo(px, py);
          });
          context.closePath();
          context.fillStyle = `rgba(${face.color.map((c) => Math.round(c * light)).join(",")},.93)`;
          context.fill();
          context.strokeStyle = "#7f8fa1";
          context.lineWidth = 1;
          context.stroke();
        });
        axes.filter((axis) => !hidden(axis))
          .forEach((axis) => arrow(q, axis, COLORS[axis], 3.2));
      }

      const here = moment(now);
      if (elevation >= 0) compass();
      if (here.reference) ghost(here.reference);
      if (here.estimate) box(here.estimate);
      if (elevation < 0) compass();
      readout(here);
    }

    function readout(here) {
      const show = (name, q) => {
        const values = q ? rollPitchYaw(q) : null;
        cells(name).forEach((cell, i) => {
          cell.textContent = values ? values[i].toFixed(1) : "\u2013";
        });
      };
      show("estimate", here.estimate);
      if (reference) show("reference", here.reference);
      const both = here.estimate && here.reference;
      cells("error").forEach((cell) => {
        cell.textContent = both ? angleBetween(here.estimate, here.reference).toFixed(2) : "\u2013";
      });
      cells("time").forEach((cell) => { cell.textContent = now.toFixed(2); });
      state.textContent = !here.estimate ? "No attitude yet: the estimator is aligning."
        : here.gap ? "In a gap of the recording: the last attitude is shown." : "";
    }

    function seek(time, announce) {
      now = Math.min(last, Math.max(first, time));
      slider.value = String(last > first ? (now - first) / (last - first) : 0);
      render();
      if (announce) {
        document.dispatchEvent(new CustomEvent("strapdown:time", { detail: { t: now } }));
      }
    }

    function frame(time) {
      if (!running) return;
      const passed = stamp === null ? 0 : (time - stamp) / 1000; // the first frame starts the clock
      seek(now + passed * Number(speed.value), true);
      stamp = time;
      if (now >= last) setRunning(false); else requestAnimationFrame(frame);
    }

    function setRunning(on) {
      running = on;
      play.textContent = on ? "Pause" : "Play";
      if (!on) return;
      if (now >= last) now = first;
      stamp = null;
      requestAnimationFrame(frame);
    }

    play.addEventListener("click", () => setRunning(!running));
    slider.addEventListener("input", () => seek(first + Number(slider.value) * (last - first), true));
    root.querySelector(".view").addEventListener("click", () => {
      azimuth = 152 / DEG;
      elevation = 24 / DEG;
      render();
    });
    document.addEventListener("strapdown:seek", (event) => seek(event.detail.t, true));
    let grip = null;
    canvas.addEventListener("pointerdown", (event) => {
      grip = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!grip) return;
      azimuth += (event.clientX - grip[0]) * 0.008;
      elevation += (event.clientY - grip[1]) * 0.008;
      elevation = Math.max(-1.45, Math.min(1.45, elevation));
      grip = [event.clientX, event.clientY];
      render();
    });
    ["pointerup", "pointercancel"].forEach((name) =>
      canvas.addEventListener(name, () => { grip = null; }));
    window.addEventListener("resize", render);
    seek(data.start_s, false);
  }

  document.querySelectorAll(".scene").forEach(start);
})();
