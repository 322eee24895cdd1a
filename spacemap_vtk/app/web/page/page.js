"use strict";
// Vue components of the page: the picture, which the mouse turns; input lines and sliders that do not
// overwrite what the user is editing; the gallery, the list of patterns and the dialog for pictures.
window.spacemap = (() => {
  const { computed, inject, onMounted, onUnmounted, ref, watch } = Vue;

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
      spellcheck="false" @input="edit" @change="submit" @keydown.esc="restore"
      @keydown.enter="$event.target.blur()">`,
    setup(props, { emit }) {
      const line = ref(null);
      let shown = "";
      // While a text is being edited, Ctrl+Z undoes typing, not changes of the scene.
      const edit = () => { line.value.dataset.edited = "yes"; };
      const restore = () => {
        line.value.value = shown = props.text ?? "";
        delete line.value.dataset.edited;
      };
      const submit = () => {
        shown = line.value.value;
        delete line.value.dataset.edited;
        emit("typed", shown);
      };
      onMounted(restore);
      watch(() => props.text, () => {
        const typing = document.activeElement === line.value && line.value.value !== shown;
        if (!typing) restore();
      });
      return { line, edit, submit, restore };
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
        if (document.querySelector("dialog[open]")) return;
        const busy = ["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(event.target.tagName);
        const key = event.key.toLowerCase(), command = event.ctrlKey || event.metaKey;
        const back = command && key === "z" && !event.shiftKey;
        const forth = command && (key === "y" || (key === "z" && event.shiftKey));
        if (event.key === " " && !busy) {
          event.preventDefault();
          trame.trigger("play", []);
        } else if ((back || forth) && !event.target.dataset?.edited) {
          event.preventDefault();
          trame.trigger(back ? "undo" : "redo", []);
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

  const Gallery = {
    props: { groups: Array, endings: Array, most: Number },
    emits: ["chosen"],
    template: `<button id="scenes" title="Open a scene or a draft" @click="show">Scenes</button>
      <dialog ref="dialog" id="gallery" aria-label="Scenes" @click="closeOutside">
        <header>
          <h2>Scenes</h2>
          <input ref="search" type="search" v-model="text" placeholder="Search scenes"
            aria-label="Search scenes" @keydown.enter="openFirst">
          <button id="file" @click="input.click()" :title="'Formats: ' + endings.join(', ')">Open draft…</button>
          <input ref="input" type="file" hidden :accept="endings.join(',')" @change="send">
          <button @click="dialog.close()">Close</button>
        </header>
        <div class="groups">
          <p v-if="message" class="message" role="alert">{{ message }}</p>
          <section v-for="part in found" :key="part.group">
            <h3>{{ part.group }}</h3>
            <div class="scenes">
              <button v-for="scene in part.scenes" :key="scene.name" class="choice" :data-name="scene.name"
                @click="choose(scene.name)">
                <img :src="'thumbnails/' + scene.name + '.jpg'" alt="" loading="lazy"><span>{{ scene.title }}</span>
              </button>
            </div>
          </section>
          <p v-if="!found.length" class="nothing">No scene matches. Search for words of a title or a name.</p>
        </div>
      </dialog>`,
    setup(props, { emit }) {
      const dialog = ref(null), search = ref(null), input = ref(null), text = ref(""), message = ref("");
      const found = computed(() => {
        const words = text.value.toLowerCase().split(/\s+/).filter(Boolean);
        return (props.groups ?? [])
          .map(part => ({
            group: part.group,
            scenes: part.scenes.filter(scene => words.every(word => scene.words.includes(word))),
          }))
          .filter(part => part.scenes.length);
      });
      const show = () => {
        message.value = "";
        dialog.value.showModal();
        search.value.focus();
      };
      const choose = name => {
        dialog.value.close();
        emit("chosen", name);
      };
      const openFirst = () => {
        if (text.value && found.value.length) choose(found.value[0].scenes[0].name);
      };
      const closeOutside = event => { if (event.target === dialog.value) dialog.value.close(); };
      async function send() {
        const file = input.value.files[0];
        input.value.value = ""; // so that the same file can be sent again
        if (!file) return;
        if (file.size > props.most) {
          message.value = `${file.name} is too large; allowed: up to ${props.most >> 20} MiB.`;
          return;
        }
        try {
          const answer = await fetch(`upload?name=${encodeURIComponent(file.name)}`,
            { method: "POST", body: file });
          message.value = answer.ok ? "" : await answer.text();
          if (answer.ok) dialog.value.close();
        } catch {
          message.value = `${file.name} could not be sent.`;
        }
      }
      return { dialog, search, input, text, message, found, show, choose, openFirst, closeOutside, send };
    },
  };

  const Save = {
    template: `<button id="picture" title="Download the view as a PNG file" @click="show">Save picture…</button>
      <dialog ref="dialog" id="save" aria-label="Save picture">
        <header><h2>Save picture</h2></header>
        <form @submit.prevent="save">
          <select id="size" v-model="size" aria-label="Size">
            <option value="">As on the page</option>
            <option>1920 × 1080</option>
            <option>3840 × 2160</option>
            <option value="other">Other size</option>
          </select>
          <div v-if="size === 'other'" class="sides">
            <input v-model="width" inputmode="numeric" aria-label="Width in pixels"> ×
            <input v-model="height" inputmode="numeric" aria-label="Height in pixels"> pixels
          </div>
          <p v-if="message" class="message" role="alert">{{ message }}</p>
          <div class="buttons">
            <button type="button" @click="leave">{{ busy ? "Cancel" : "Close" }}</button>
            <button class="main" :disabled="busy">{{ busy ? "Drawing…" : "Save" }}</button>
          </div>
        </form>
      </dialog>`,
    setup() {
      const trame = inject("trame");
      const dialog = ref(null), size = ref(""), message = ref(""), busy = ref(false);
      const width = ref("2000"), height = ref("2000");
      const show = () => {
        message.value = "";
        dialog.value.showModal();
      };
      async function save() {
        const [w, h] = size.value === "other" ? [width.value, height.value] : size.value.split(" × ");
        const query = size.value ? `?${new URLSearchParams({ width: w.trim(), height: h.trim() })}` : "";
        busy.value = true;
        message.value = "";
        try {
          const answer = await fetch(`picture.png${query}`);
          if (!answer.ok) throw new Error(await answer.text());
          const name = answer.headers.get("Content-Disposition").split("''")[1];
          const link = document.createElement("a");
          link.href = URL.createObjectURL(await answer.blob());
          link.download = decodeURIComponent(name);
          link.click();
          setTimeout(() => URL.revokeObjectURL(link.href), 10000);
          dialog.value.close();
        } catch (error) {
          message.value = error.message;
        }
        busy.value = false;
      }
      const leave = () => (busy.value ? trame.trigger("cancel", []) : dialog.value.close());
      return { dialog, size, message, busy, width, height, show, leave, save };
    },
  };

  const Pattern = {
    props: { id: String, text: String, hint: String, repeat: Array, chosen: String, patterns: Array },
    emits: ["typed", "chosen"],
    template: `<spacemap-line :id="id" :text="text" :hint="hint" @typed="text => $emit('typed', text)"></spacemap-line>
      <div v-if="repeat" class="weave">
        <svg :width="side * repeat[0].length" :height="side * repeat.length" role="img" aria-label="One repeat">
          <g v-for="(row, pick) in repeat" :key="pick">
            <rect v-for="(over, end) in row" :key="end" :x="end * side" :y="(repeat.length - 1 - pick) * side"
              :width="side - 1" :height="side - 1" :fill="over === '1' ? '#2d6a8e' : '#e8c78f'"
              @click="invert(pick, end)"></rect>
          </g>
        </svg>
        <span>{{ repeat[0].length }} ends, {{ repeat.length }} picks. Click a square to change what lies on top.</span>
      </div>
      <div class="patterns">
        <template v-for="drafts in [false, true]" :key="drafts">
          <h3>{{ drafts ? "Drafts" : "Patterns" }}</h3>
          <button v-for="item in patterns.filter(each => each.name.startsWith('drafts/') === drafts)" :key="item.name"
            class="choice" :title="item.title" :data-name="item.name" :aria-pressed="item.name === chosen"
            @click="$emit('chosen', item.name)">
            <img :src="item.picture" alt=""><span>{{ item.title }}</span>
          </button>
        </template>
      </div>`,
    setup(props, { emit }) {
      const side = computed(() => Math.max(7, Math.min(20, Math.floor(140 / props.repeat.length))));
      const invert = (pick, end) => {
        const rows = props.repeat.map((row, at) => (at !== pick ? row
          : row.slice(0, end) + (row[end] === "1" ? "0" : "1") + row.slice(end + 1)));
        emit("typed", JSON.stringify(rows));
      };
      return { side, invert };
    },
  };

  return {
    install(app) {
      app.component("SpacemapGallery", Gallery);
      app.component("SpacemapSave", Save);
      app.component("SpacemapPattern", Pattern);
      app.component("SpacemapLine", Line);
      app.component("SpacemapSlider", Slider);
      app.component("SpacemapPicture", Picture);
    },
  };
})();
