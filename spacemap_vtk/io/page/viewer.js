// Camera, time and controls of the page.

const VIEW_ANGLE = (24 * Math.PI) / 180; // as in the program
const MOST = 2.3e6; // largest canvas that is drawn with four pixels for each pixel
const MARGIN = 0.04; // empty share of the free area at each edge
const KEYS = ["three-quarter", "front", "side", "top", "lying", "face"];
// Views of the buttons if z is up. The keys are those of the program.
const LYING = { "three-quarter": "lying", front: [[0, -1, 0], [0, 0, 1]], side: [[1, 0, 0], [0, 0, 1]], top: "front" };
const SPEEDS = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5];

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const sum = (a, b, share = 1) => a.map((part, i) => part + share * b[i]);

/** Camera on a turntable about y, or about z if the object lies level. */
class Camera {
  constructor(sight) {
    Object.assign(this, { sight, focus: [0, 0, 0], distance: 1, flat: false, upright: true });
  }

  /** Unit vectors to the right, up, and towards the eye. */
  get axes() {
    const { yaw, pitch } = this, c = Math.cos(pitch);
    const world = ([x, y, z]) => (this.upright ? [x, y, z] : [x, -z, y]);
    const right = world([Math.cos(yaw), 0, -Math.sin(yaw)]);
    const toward = world([Math.sin(yaw) * c, Math.sin(pitch), Math.cos(yaw) * c]);
    return [right, cross(toward, right), toward];
  }

  /** Show all points from the direction of a view, in the free area of the page. */
  aim(view, points, free) {
    const [direction, up] = this.sight.cameras[view] ?? view, size = Math.hypot(...direction);
    this.upright = up[2] < 0.5;
    const [x, y, z] = (this.upright ? direction : [direction[0], direction[2], -direction[1]]).map((part) => part / size);
    this.yaw = Math.atan2(x, z);
    this.pitch = Math.asin(y);
    this.flat = view === "face";
    const axes = this.axes, slope = Math.tan(VIEW_ANGLE / 2) * free.height * (1 - 2 * MARGIN);
    const wide = slope * free.aspect;
    const seen = [];
    for (let i = 0; i < points.length; i += 3) {
      const point = [points[i], points[i + 1], points[i + 2]];
      seen.push(axes.map((axis) => dot(axis, point)));
    }
    const ends = (of) => seen.reduce(([low, high], each) => [Math.min(low, of(each)), Math.max(high, of(each))], [Infinity, -Infinity]);
    const middle = [0, 1, 2].map((k) => { const [low, high] = ends((each) => each[k]); return (low + high) / 2; });
    // Near points look larger, so the centre of the picture is not the centre of the points.
    for (let round = 0; round < 4; round++) {
      const off = (each, k) => each[k] - middle[k], near = (each) => (this.flat ? 0 : off(each, 2));
      this.distance = ends((each) => Math.max(Math.abs(off(each, 0)) / wide, Math.abs(off(each, 1)) / slope) + near(each))[1];
      for (const k of [0, 1]) {
        const [low, high] = ends((each) => off(each, k) / (this.distance - near(each)));
        middle[k] += ((low + high) / 2) * this.distance;
      }
    }
    this.focus = axes.reduce((place, axis, k) => sum(place, axis, middle[k]), [0, 0, 0]);
    if (view === this.sight.camera) this.distance /= this.sight.zoom;
    this.free = free;
  }

  turn(across, up) {
    this.yaw -= 0.007 * across;
    this.pitch = Math.min(Math.max(this.pitch + 0.007 * up, -Math.PI / 2), Math.PI / 2);
  }

  /** Return the size of a pixel at the centre of rotation, in m. */
  pixel(height) {
    return (2 * this.distance * Math.tan(VIEW_ANGLE / 2)) / height;
  }

  move(across, up, height) {
    const [right, above] = this.axes, metres = this.pixel(height);
    this.focus = sum(sum(this.focus, right, -across * metres), above, up * metres);
  }

  /** Move towards the point at a position of the page, which is counted from its centre. */
  approach(factor, across, up, height, reach) {
    const distance = Math.min(Math.max(this.distance / factor, 0.002 * reach), 50 * reach);
    const kept = distance / this.distance;
    this.move(-across * (1 - kept), -up * (1 - kept), height);
    this.distance = distance;
  }

  /**
   * Return the camera for `Drawing.choose`, for a page of this size and points inside a ball.
   */
  matrices(width, height, ball, fold) {
    const { flat, distance, free } = this, [right, up, toward] = this.axes;
    const place = sum(this.focus, toward, distance);
    const rows = [right, up, toward];
    const eye = [0, 1, 2].flatMap((c) => [...rows.map((row) => row[c]), 0]);
    eye.push(...rows.map((row) => -dot(row, place)), 1);
    const depth = dot(sum(place, ball.middle, -1), toward);
    const far = Math.max(depth + ball.radius, 1e-6 * distance);
    const near = flat ? depth - ball.radius : Math.max(depth - ball.radius, 0.002 * far);
    const slope = Math.tan(VIEW_ANGLE / 2), y = 1 / (flat ? slope * distance : slope), x = (y * height) / width;
    const lens = flat
      ? [x, 0, 0, 0, 0, y, 0, 0, 0, 0, -2 / (far - near), 0, free.right, free.up, -(far + near) / (far - near), 1]
      : [x, 0, 0, 0, 0, y, 0, 0, -free.right, -free.up, -(far + near) / (far - near), -1, 0, 0, (-2 * far * near) / (far - near), 0];
    const scale = 1 / this.pixel(height); // pixels of a metre at the centre of rotation
    return { eye, lens, flat, distance, range: [near, far], scale, fold: fold * scale, point: height / innerHeight };
  }
}

/** Return a function that formats times, with one unit for the whole clip. */
function timeFormat(end, step) {
  const [unit, size] = [["s", 1], ["ms", 1e-3], ["µs", 1e-6]].find(([, size]) => end >= 0.9999 * size) ?? ["µs", 1e-6];
  const digits = Math.min(Math.max(Math.ceil(-Math.log10(step / size) - 1e-9), 0), 3);
  return (time) => `${(time / size).toFixed(digits)} ${unit}`;
}

class Viewer {
  constructor(content, arrays) {
    Object.assign(this, { content, arrays, camera: new Camera(content.sight), playing: false, wanted: false });
    this.canvas = document.getElementById("canvas");
    this.drawing = new Drawing(this.canvas, content, arrays);
    this.clips = content.clips.length ? content.clips : [{ name: "", times: [0], weights: [], start: 0, speed: 1 }];
    this.room = this.reached();
    this.element = (id) => document.getElementById(id);
    this.theme();
    this.words();
    this.chooseClip(0);
    this.hands();
    this.reset();
    this.element("message").hidden = true;
  }

  /** Find positions of some points over all times, and a ball that contains all points. */
  reached() {
    const some = [], count = this.arrays.points.length / 3 - this.content.plane_points; // planes have no end
    const apart = Math.max(1, Math.floor(count / 4000));
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const { times, weights } of this.clips.slice(0, 12)) {
      const turns = times.length > 1 ? 9 : 1;
      for (let k = 0; k < turns; k++) {
        this.drawing.weigh(weightsAt(times, weights, (times.at(-1) * k) / Math.max(turns - 1, 1)), []);
        const found = this.drawing.points();
        for (let i = 0; i < found.length; i++) {
          const axis = i % 3;
          if (found[i] < low[axis]) low[axis] = found[i];
          if (found[i] > high[axis]) high[axis] = found[i];
        }
        for (let i = 0; i < count; i += apart) some.push(...found.subarray(3 * i, 3 * i + 3));
      }
    }
    const middle = low.map((part, axis) => (part + high[axis]) / 2);
    return { points: some, middle, radius: 1.02 * Math.hypot(...sum(high, middle, -1)) };
  }

  /** Choose light or dark, by the system or by the scene's background if it has one. */
  theme() {
    const system = matchMedia("(prefers-color-scheme: dark)"), own = this.content.sight.background;
    const choose = () => {
      const dark = own ? rgb(own[0]).reduce((total, part) => total + part) < 1.5 : system.matches;
      const root = document.documentElement;
      root.dataset.theme = dark ? "dark" : "light";
      const usual = ["--below", "--above"].map((name) => getComputedStyle(root).getPropertyValue(name).trim());
      this.background = (own ?? usual).map(rgb);
      this.requestFrame();
    };
    system.addEventListener("change", choose);
    choose();
  }

  words() {
    const { figures, numbers, sight } = this.content;
    this.element("figures").textContent = figures.join(" · ");
    const views = this.element("views");
    views.hidden = false;
    for (const button of views.children) {
      const { view } = button.dataset, lying = sight.camera === "lying";
      if (lying) button.removeAttribute("title");
      button.onclick = () => this.reset(lying ? LYING[view] : view);
    }
    if (!numbers) return;
    const scale = this.element("scale"), [low, high] = numbers.span;
    scale.hidden = false;
    scale.firstElementChild.textContent = numbers.title;
    this.element("ramp").style.background = `linear-gradient(to top, ${numbers.ramp.join(",")})`;
    for (const share of [1, 0.75, 0.5, 0.25, 0]) {
      const tick = document.createElement("span");
      tick.textContent = Number((low + share * (high - low)).toPrecision(3));
      this.element("ticks").append(tick);
    }
  }

  get moves() {
    return this.clips[0].times.length > 1;
  }

  /** Show another clip, from its start. */
  chooseClip(number) {
    this.clip = this.clips[number];
    const { times, start, speed } = this.clip, film = times.at(-1);
    this.start = start;
    this.end = start + film * speed;
    this.step = (film * speed) / Math.max(times.length - 1, 1);
    this.format = timeFormat(this.end, Math.min(this.step, (this.end - start) / 50) || 1);
    const bar = this.element("bar"), slider = this.element("slider"), select = this.element("clip");
    bar.hidden = !this.moves;
    Object.assign(slider, { min: this.start, max: this.end });
    if (!select.options.length) this.clips.forEach(({ name }, i) => select.add(new Option(name, i)));
    select.hidden = this.clips.length < 2;
    this.element("loop").hidden = !select.hidden; // the oscillation of a mode always repeats
    const speeds = [...new Set([...SPEEDS, Number(speed.toPrecision(3))])].sort((a, b) => a - b);
    this.element("speed").replaceChildren(...speeds.map((each) => new Option(`${each} ×`, each)));
    this.element("speed").value = Number(speed.toPrecision(3));
    this.element("time").style.minWidth = `${this.format(this.end).length + 0.5}ch`;
    this.go(this.start);
  }

  /** Show a time [s]. */
  go(time) {
    this.time = Math.min(Math.max(time, this.start), this.end);
    const slider = this.element("slider"), shown = this.format(this.time);
    slider.value = this.time;
    slider.style.setProperty("--share", `${(100 * (this.time - this.start)) / (this.end - this.start || 1)}%`);
    slider.setAttribute("aria-valuetext", shown);
    this.element("time").textContent = shown;
    this.requestFrame();
  }

  play(on = !this.playing) {
    this.playing = on && this.moves;
    const button = this.element("play");
    button.setAttribute("aria-pressed", this.playing);
    button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
    if (this.playing && this.time >= this.end) this.go(this.start);
    this.clock = null;
    this.requestFrame();
  }

  /** Request a picture, which is drawn when the browser is ready. */
  requestFrame() {
    this.settled = false;
    if (this.wanted) return;
    this.wanted = true;
    requestAnimationFrame((now) => {
      this.wanted = false;
      if (this.playing) {
        const on = this.clock === null ? 0 : (now - this.clock) / 1000;
        this.clock = now;
        let time = this.time + on * Number(this.element("speed").value);
        if (time > this.end) {
          if (this.element("loop").getAttribute("aria-pressed") === "true") time = this.start + ((time - this.start) % (this.end - this.start));
          else this.play(false);
        }
        this.go(time);
      }
      this.draw();
    });
  }

  /** Set the weights of the shapes at a time. */
  weigh(time) {
    const { times, weights, start, speed } = this.clip, film = (time - start) / speed;
    const changes = this.content.numbers ? weightsAt(times, this.content.numbers.weights, film) : [];
    this.drawing.weigh(weightsAt(times, weights, film), changes);
  }

  draw(atRest = false) {
    if (this.drawing.gl.isContextLost()) return;
    const { canvas, content } = this, dense = Math.min(devicePixelRatio, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((size) => Math.max(1, Math.round(size * dense)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    this.weigh(this.time);
    const camera = this.drawing.choose(this.camera.matrices(width, height, this.room, content.sight.relief));
    // Draw four pixels for each one if there is time, and always when nothing moves any more. A sheet
    // needs one: its shader computes the mean of everything in a pixel.
    const now = performance.now(), since = now - (this.last ?? now), hurried = !atRest && (this.playing || since < 250);
    if (hurried && since > 0) this.pace = 0.8 * (this.pace ?? 16) + 0.2 * Math.min(since, 200);
    const plain = width * height > MOST || !camera.yarns, fine = plain || (hurried && this.pace > 30) ? 1 : 2;
    this.last = now;
    clearTimeout(this.rest);
    this.settled = !this.playing && (fine === 2 || plain);
    if (!this.settled && !this.playing) this.rest = setTimeout(() => this.requestFrame(), 260);
    this.drawing.resize(fine);
    this.drawing.draw(camera, ...this.background);
  }

  /** Return the present picture as a data URL of a PNG. For scripts. */
  picture() {
    this.draw(true);
    return this.canvas.toDataURL();
  }

  /** Return all positions at a time, in m: x, y, z, one after another. For scripts. */
  points(time) {
    this.weigh(time);
    this.requestFrame(); // the browser considers the canvas as drawn upon, so it must be drawn again
    return this.drawing.points();
  }

  /** The area that texts and buttons leave free, in shares of the page. */
  get free() {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    const narrow = width <= 640, [scale, views, bar, words] = ["scale", "views", "bar", "figures"].map(this.element);
    const above = bar.hidden ? 14 : bar.offsetHeight + 26, top = words.getBoundingClientRect().bottom + 10;
    views.style.bottom = narrow ? `${above}px` : "";
    const bottom = narrow ? above + views.offsetHeight + 10 : above;
    const right = scale.hidden ? 0 : scale.offsetWidth + 34;
    const share = Math.max(1 - (top + bottom) / height, 0.3);
    return { height: share, aspect: (width - right) / (height * share), right: -right / width, up: (bottom - top) / height };
  }

  /** Show all points, by default from the scene's camera. */
  reset(view = this.content.sight.camera) {
    const { free } = this;
    this.camera.aim(view, this.room.points, free);
    this.requestFrame();
  }

  /** Handle mouse, touch and keys. */
  hands() {
    const { canvas, camera } = this, fingers = new Map();
    const fromMiddle = (x, y) => [x - canvas.clientWidth * (0.5 + camera.free.right / 2), canvas.clientHeight * (0.5 - camera.free.up / 2) - y];
    const nearer = (factor, x, y) => camera.approach(factor, ...fromMiddle(x, y), canvas.clientHeight, this.room.radius);
    const spread = () => {
      const [a, b] = [...fingers.values()];
      return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.hypot(a.x - b.x, a.y - b.y) };
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY, moves: event.button !== 0 || event.shiftKey });
    });
    canvas.addEventListener("pointermove", (event) => {
      const finger = fingers.get(event.pointerId);
      if (!finger) return;
      const before = fingers.size === 2 ? spread() : finger;
      const { x, y, apart } = before;
      Object.assign(finger, { x: event.clientX, y: event.clientY });
      const now = fingers.size === 2 ? spread() : finger;
      if (fingers.size === 2) {
        camera.move(now.x - x, now.y - y, canvas.clientHeight);
        nearer(now.apart / Math.max(apart, 1), now.x, now.y);
      } else if (finger.moves) camera.move(now.x - x, now.y - y, canvas.clientHeight);
      else camera.turn(now.x - x, now.y - y);
      this.requestFrame();
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => this.reset());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 33 : 1;
      nearer(Math.exp(-0.0015 * lines * event.deltaY), event.clientX, event.clientY);
      this.requestFrame();
    }, { passive: false });
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      this.drawing = new Drawing(canvas, this.content, this.arrays);
      this.requestFrame();
    });
    addEventListener("resize", () => {
      const room = ({ height, aspect }) => height * Math.min(1, aspect), before = room(camera.free);
      camera.free = this.free;
      camera.distance *= before / room(camera.free); // what was in view stays so, as on a phone that is turned
      this.requestFrame();
    });
    this.element("play").onclick = () => this.play();
    this.element("slider").oninput = (event) => { this.play(false); this.go(Number(event.target.value)); };
    this.element("clip").onchange = (event) => this.chooseClip(Number(event.target.value));
    this.element("loop").onclick = ({ currentTarget: loop }) => loop.setAttribute("aria-pressed", loop.getAttribute("aria-pressed") !== "true");
    const keys = {
      " ": () => this.play(), Home: () => this.go(this.start), End: () => this.go(this.end),
      ",": () => this.go(this.time - this.step), ".": () => this.go(this.time + this.step),
      ArrowUp: () => (camera.distance /= 1.05), ArrowDown: () => (camera.distance *= 1.05),
      r: () => this.reset(), v: () => this.reset("three-quarter"), o: () => (camera.flat = !camera.flat),
    };
    KEYS.forEach((name, i) => (keys[i + 1] = () => this.reset(name)));
    addEventListener("keydown", (event) => {
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      const typing = event.target instanceof HTMLSelectElement || event.ctrlKey || event.metaKey || event.altKey;
      if (typing || !keys[key] || (key === " " && event.target instanceof HTMLButtonElement)) return;
      event.preventDefault();
      keys[key]();
      this.requestFrame();
    });
  }
}

function showError(why) {
  document.querySelector("#message p").textContent = why;
}

if (!document.createElement("canvas").getContext("webgl2"))
  showError("This page needs WebGL 2, which this browser does not offer. Use a recent Firefox, Chrome, Edge or Safari, and switch on graphics acceleration in its settings.");
else if (!("DecompressionStream" in window))
  showError("This browser is too old for this page. Use Firefox, Chrome, Edge or Safari of 2023 or later.");
else
  (async () => {
    const content = readJson("content");
    window.spacemap = new Viewer(content, await unpack(content.arrays));
  })().catch((error) => {
    showError(`This page cannot be shown: ${error.message}`);
    throw error;
  });
