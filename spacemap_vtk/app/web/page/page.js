"use strict";
// What the page's template has that HTML has not: the picture that the mouse takes hold of, and
// lines and sliders that leave alone what the user is at.
window.spacemap = (() => {
  const { inject, onMounted, onUnmounted, ref, watch } = Vue;

  // Let one call go on at a time; of those that come meanwhile `joined` makes one.
  function paced(call, joined = (_before, now) => now) {
    let waiting, going = false;
    return async function ask(value) {
      waiting = waiting === undefined ? value : joined(waiting, value);
      if (going) return;
      going = true;
      while (waiting !== undefined) {
        const now = waiting;
        waiting = undefined;
        try {
          await call(now);
        } catch {
          break; // the program has ended, and the page will say so
        }
        await new Promise(requestAnimationFrame);
      }
      going = false;
    };
  }

  const Line = {
    props: { id: String, text: String, hint: String, label: String },
    emits: ["typed"],
    template: `<input ref="line" :id="id" :placeholder="hint" :aria-label="label" autocomplete="off"
      spellcheck="false" @change="take" @keydown.esc="back" @keydown.enter="$event.target.blur()">`,
    setup(props, { emit }) {
      const line = ref(null);
      let shown = "";
      const back = () => { line.value.value = shown = props.text ?? ""; };
      const take = () => { shown = line.value.value; emit("typed", shown); };
      onMounted(back);
      watch(() => props.text, () => {
        const typing = document.activeElement === line.value && line.value.value !== shown;
        if (!typing) back();
      });
      return { line, take, back };
    },
  };

  const Slider = {
    // `slid` is awaited: on a slow line, steps that are late are left out.
    props: { step: Number, most: Number, label: String, slid: Function },
    template: `<input ref="slider" type="range" min="0" :max="most" :aria-label="label"
      @input="slide(true)" @change="slide(false)">`,
    setup(props) {
      const slider = ref(null), held = ref(false);
      const tell = paced(([step, on]) => props.slid(step, on));
      const slide = on => { held.value = on; tell([Number(slider.value.value), on]); };
      const show = () => { if (!held.value) slider.value.value = props.step; };
      onMounted(show);
      watch(() => props.step, show);
      return { slider, slide };
    },
  };

  const Picture = {
    props: { version: Number, alt: String },
    template: `<div ref="box" class="picture" tabindex="0" @pointerdown="down" @pointermove="move"
      @pointerup="up" @pointercancel="up" @wheel.prevent="wheel" @dblclick="whole"
      @contextmenu.prevent><img ref="image" draggable="false" :alt="alt" v-show="there"></div>`,
    setup(props) {
      const trame = inject("trame");
      const box = ref(null), image = ref(null), there = ref(false);

      // One picture at a time: on a slow line those that are late are left out.
      let loaded = 0, loading = false;
      function load() {
        if (loading || !image.value || !props.version || props.version === loaded) return;
        loading = true;
        loaded = props.version;
        image.value.src = `picture.jpg?${loaded}`;
      }
      function end(good) {
        loading = false;
        there.value = there.value || good;
        if (good) load();
      }
      watch(() => props.version, load);

      const steer = paced(moves => trame.trigger("steer", [moves]), (before, now) => {
        const last = before[before.length - 1], [kind, x, y] = now[0];
        if (last[0] !== kind) return [...before, ...now];
        const both = kind === "zoom" ? [kind, last[1] * x, 0] : [kind, last[1] + x, last[2] + y];
        return [...before.slice(0, -1), both];
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
      const whole = () => trame.trigger("aim", []);

      const theme = window.matchMedia("(prefers-color-scheme: dark)");
      const fit = paced(() => trame.trigger("resize",
        [box.value.clientWidth, box.value.clientHeight, window.devicePixelRatio, theme.matches]));
      const sizes = new ResizeObserver(() => fit(true));
      const press = event => {
        const busy = ["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(event.target.tagName);
        if (event.key === " " && !busy) {
          event.preventDefault();
          trame.trigger("play", []);
        }
      };
      onMounted(() => {
        image.value.onload = () => end(true);
        image.value.onerror = () => end(false);
        sizes.observe(box.value);
        theme.addEventListener("change", fit);
        window.addEventListener("keydown", press);
        load();
      });
      onUnmounted(() => {
        sizes.disconnect();
        theme.removeEventListener("change", fit);
        window.removeEventListener("keydown", press);
      });
      return { box, image, there, down, move, up, wheel, whole };
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
