"use strict";
// Vue components of the page: the picture, which the mouse turns, and input lines and sliders that do
// not overwrite what the user is editing.
window.spacemap = (() => {
  const { inject, onMounted, onUnmounted, ref, watch } = Vue;

  // Run one call at a time; `merge` combines the values that arrive meanwhile into one.
  function throttle(call, merge = (_waiting, value) => value) {
    let waiting, running = false;
    return async function request(value) {
      waiting = waiting === undefined ? value : merge(waiting, value);
      if (running) return;
      running = true;
      while (waiting !== undefined) {
        const next = waiting;
        waiting = undefined;
        try {
          await call(next);
        } catch {
          break; // the program has ended; trame replaces the page
        }
        await new Promise(requestAnimationFrame);
      }
      running = false;
    };
  }

  const Line = {
    props: { id: String, text: String, hint: String, label: String },
    emits: ["typed"],
    template: `<input ref="line" :id="id" :placeholder="hint" :aria-label="label" autocomplete="off"
      spellcheck="false" @change="submit" @keydown.esc="restore" @keydown.enter="$event.target.blur()">`,
    setup(props, { emit }) {
      const line = ref(null);
      let shown = "";
      const restore = () => { line.value.value = shown = props.text ?? ""; };
      const submit = () => { shown = line.value.value; emit("typed", shown); };
      onMounted(restore);
      watch(() => props.text, () => {
        const typing = document.activeElement === line.value && line.value.value !== shown;
        if (!typing) restore();
      });
      return { line, submit, restore };
    },
  };

  const Slider = {
    // `send` is awaited, so that a slow connection skips steps.
    props: { step: Number, most: Number, label: String, send: Function },
    template: `<input ref="slider" type="range" min="0" :max="most" :aria-label="label"
      @input="slide(true)" @change="slide(false)">`,
    setup(props) {
      const slider = ref(null), held = ref(false);
      const send = throttle(([step, dragging]) => props.send(step, dragging));
      const slide = dragging => {
        held.value = dragging;
        send([Number(slider.value.value), dragging]);
      };
      const show = () => { if (!held.value) slider.value.value = props.step; };
      onMounted(show);
      watch(() => props.step, show);
      return { slider, slide };
    },
  };

  const Picture = {
    props: { version: Number, alt: String },
    template: `<div ref="box" class="picture" tabindex="0" @pointerdown="down" @pointermove="move"
      @pointerup="up" @pointercancel="up" @wheel.prevent="wheel" @dblclick="fitView"
      @contextmenu.prevent><img ref="image" draggable="false" :alt="alt" v-show="loadedOnce"></div>`,
    setup(props) {
      const trame = inject("trame");
      const box = ref(null), image = ref(null), loadedOnce = ref(false);

      // Load one picture at a time, so that a slow connection skips pictures.
      let loaded = 0, loading = false;
      function load() {
        if (loading || !image.value || !props.version || props.version === loaded) return;
        loading = true;
        loaded = props.version;
        image.value.src = `picture.jpg?${loaded}`;
      }
      function finish(succeeded) {
        loading = false;
        loadedOnce.value = loadedOnce.value || succeeded;
        if (succeeded) load();
      }
      watch(() => props.version, load);

      const steer = throttle(moves => trame.trigger("steer", [moves]), (waiting, moves) => {
        const last = waiting[waiting.length - 1], [kind, x, y] = moves[0];
        if (last[0] !== kind) return [...waiting, ...moves];
        const sum = kind === "zoom" ? [kind, last[1] * x, 0] : [kind, last[1] + x, last[2] + y];
        return [...waiting.slice(0, -1), sum];
      });
      const fingers = new Map();
      let kind = "turn";
      const spread = () => {
        const [a, b] = [...fingers.values()];
        return Math.hypot(a.x - b.x, a.y - b.y) || 1;
      };
      function down(event) {
        box.value.setPointerCapture(event.pointerId);
        fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
        kind = event.button === 2 || event.ctrlKey ? "zoom"
          : event.button === 1 || event.shiftKey || fingers.size > 1 ? "move" : "turn";
      }
      function move(event) {
        const finger = fingers.get(event.pointerId);
        if (!finger) return;
        const before = fingers.size > 1 ? spread() : 0;
        const x = (event.clientX - finger.x) / box.value.clientWidth / fingers.size;
        const y = (finger.y - event.clientY) / box.value.clientHeight / fingers.size;
        finger.x = event.clientX;
        finger.y = event.clientY;
        steer([kind === "zoom" ? ["zoom", Math.exp(3 * y), 0] : [kind, x, y]]);
        if (before) steer([["zoom", spread() / before, 0]]);
      }
      function up(event) {
        fingers.delete(event.pointerId);
      }
      function wheel(event) {
        const lines = event.deltaMode === 1 ? 30 : 1;
        steer([["zoom", Math.exp(-event.deltaY * lines / 500), 0]]);
      }
      const fitView = () => trame.trigger("aim", []);

      const theme = window.matchMedia("(prefers-color-scheme: dark)");
      const resize = throttle(() => trame.trigger("resize",
        [box.value.clientWidth, box.value.clientHeight, window.devicePixelRatio, theme.matches]));
      const sizes = new ResizeObserver(() => resize(true));
      const press = event => {
        const busy = ["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(event.target.tagName);
        if (event.key === " " && !busy) {
          event.preventDefault();
          trame.trigger("play", []);
        }
      };
      onMounted(() => {
        image.value.onload = () => finish(true);
        image.value.onerror = () => finish(false);
        sizes.observe(box.value);
        theme.addEventListener("change", resize);
        window.addEventListener("keydown", press);
        load();
      });
      onUnmounted(() => {
        sizes.disconnect();
        theme.removeEventListener("change", resize);
        window.removeEventListener("keydown", press);
      });
      return { box, image, loadedOnce, down, move, up, wheel, fitView };
    },
  };

  return {
    install(app) {
      app.component("SpacemapLine", Line);
      app.component("SpacemapSlider", Slider);
      app.component("SpacemapPicture", Picture);
    },
  };
})();
