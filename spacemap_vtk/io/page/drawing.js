// Draw the surface: the vertex shader adds up the shapes, the fragment shader computes the light.
// Folds are darkened afterwards, by the depth of their surroundings.

const ACROSS = 2048; // texels in a row of the shapes' textures; every WebGL 2 supports this
const FINEST = 3; // pixels from yarn to yarn: finer yarns cause moiré

const VERTEX = `#version 300 es
precision highp float; precision highp int;
precision highp isampler2DArray; precision highp sampler2D;
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 facing;
layout(location = 2) in vec3 color;
layout(location = 3) in float value;
layout(location = 4) in float open;
uniform isampler2DArray shapes, turns, changes; // of each point, one layer for each shape
uniform sampler2D weights; // row 0: of the shapes, row 1: of the changes
uniform ivec2 counts;
uniform vec3 middle;
uniform float unit; // of positions, in m
uniform mat4 eye, lens;
out vec3 at, normal, seen, albedo;
out float number, exposure;
void main() {
  ivec2 own = ivec2(gl_VertexID % ${ACROSS}, gl_VertexID / ${ACROSS});
  vec3 moved = place, turned = facing;
  number = value;
  exposure = open;
  for (int k = 0; k < counts.x; k++) {
    float weight = texelFetch(weights, ivec2(k, 0), 0).r;
    if (weight == 0.0) continue;
    moved += weight * vec3(texelFetch(shapes, ivec3(own, k), 0).rgb);
    turned += weight * vec3(texelFetch(turns, ivec3(own, k), 0).rgb);
  }
  for (int k = 0; k < counts.y; k++)
    number += texelFetch(weights, ivec2(k, 1), 0).r * float(texelFetch(changes, ivec3(own, k), 0).r);
  at = middle + unit * moved;
  vec4 there = eye * vec4(at, 1.0);
  seen = there.xyz;
  normal = mat3(eye) * turned;
  albedo = color;
  gl_Position = lens * there;
}`;

// Yarns have the light of pictures, and their contact shadows if these are known.
const fragment = ({ light, outline }) => `#version 300 es
precision highp float;
in vec3 at, normal, seen, albedo;
in float number, exposure;
uniform bool smoothly, scaled, flat_;
uniform sampler2D ramp;
uniform vec2 span; // range of the numbers, in their unit
uniform float limit; // depth from which on the yarns are drawn as a sheet
uniform float point; // drawn pixels of a pixel of the page
out vec4 pixel; // linear light
${light}${outline}
void main() {
  vec3 toward = flat_ ? vec3(0, 0, 1) : normalize(-seen);
  vec3 n = smoothly ? normal : cross(dFdx(seen), dFdy(seen));
  n = dot(n, n) > 0.0 ? normalize(n) : toward;
  if (dot(n, toward) < 0.0) n = -n;
  vec3 hue = albedo;
  if (scaled) {
    float share = clamp((number - span.x) / (span.y - span.x), 0.0, 1.0);
    hue = texture(ramp, vec2(0.5 / 256.0 + share * 255.0 / 256.0, 0.5)).rgb;
  }
  float line = outlineAt(n, toward, point * lineWidth);
  if (-seen.z > limit) discard; // after the derivatives
  vec4 lit = shadedLight(reflectedLight(n, toward), exposure, hue);
  pixel = vec4(decoded(visibleColor(hue, lit, line)), 1.0);
}`;

const WHOLE = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0, 1); }`;

// Distance of a pixel behind the centre of rotation, in depths of a fold.
const DEPTH = `
precision highp float; precision highp sampler2D;
uniform sampler2D depth;
uniform vec4 range; // nearest and farthest depth, depth of the centre, depth of a fold
uniform bool flat_;
bool behind(ivec2 pixel, out float far) {
  float z = texelFetch(depth, pixel, 0).r;
  float d = flat_ ? mix(range.x, range.y, z)
    : range.x * range.y / (range.y - z * (range.y - range.x));
  far = (d - range.z) / range.w;
  return z < 1.0;
}`;

const COARSER = `#version 300 es
${DEPTH}
uniform int factor;
out vec2 mean;
void main() {
  ivec2 first = ivec2(gl_FragCoord.xy) * factor, size = textureSize(depth, 0);
  ivec2 last = min(first + factor, size);
  int stride = max(1, factor / 4);
  float taken = 0.0;
  mean = vec2(0);
  for (int y = first.y; y < last.y; y += stride) for (int x = first.x; x < last.x; x += stride) {
    float far;
    taken += 1.0;
    if (behind(ivec2(x, y), far)) mean += vec2(far, 1);
  }
  mean /= max(taken, 1.0);
}`;

const BLUR = `#version 300 es
precision highp float; precision highp sampler2D;
uniform sampler2D image;
uniform ivec2 along;
uniform float sigma;
out vec2 mean;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy), last = textureSize(image, 0) - 1;
  int reach = min(int(2.5 * sigma + 0.5), 24);
  float total = 0.0;
  mean = vec2(0);
  for (int i = -reach; i <= reach; i++) {
    float share = exp(-0.5 * float(i * i) / (sigma * sigma));
    mean += share * texelFetch(image, clamp(at + i * along, ivec2(0), last), 0).rg;
    total += share;
  }
  mean /= total;
}`;

// Each pixel is darkened by its distance behind the mean depth of its surroundings, near and wide
// (Luft, Colditz, Deussen 2006). A pixel of the canvas is the mean of several, over the background.
const compose = ({ light }) => `#version 300 es
${DEPTH}
uniform sampler2D drawn, near, wide;
uniform vec2 factors, size;
uniform bool dimmed;
uniform int fine;
uniform vec3 below, above;
out vec4 pixel;
${light}
float mean(sampler2D image, ivec2 pixel, float factor) {
  vec2 at = (vec2(pixel) + 0.5) / factor - 0.5, share = fract(at);
  ivec2 low = ivec2(floor(at)), last = textureSize(image, 0) - 1;
  vec2 found = vec2(0);
  for (int k = 0; k < 4; k++) {
    ivec2 step = ivec2(k & 1, k >> 1);
    vec2 part = mix(1.0 - share, share, vec2(step));
    found += part.x * part.y * texelFetch(image, clamp(low + step, ivec2(0), last), 0).rg;
  }
  return found.x / max(found.y, 1e-6);
}
float kept(float behind, float darkness, float radius) {
  // a pixel far behind its surroundings is behind the edge of a flap, which is no fold
  return 1.0 - clamp(behind / radius, 0.0, 1.0) * darkness * mix(1.0, 0.4, smoothstep(0.8, 3.0, behind));
}
void main() {
  vec4 color = vec4(0);
  for (int k = 0; k < fine * fine; k++) {
    ivec2 at = ivec2(gl_FragCoord.xy) * fine + ivec2(k % fine, k / fine);
    vec4 one = texelFetch(drawn, at, 0);
    float far;
    if (dimmed && behind(at, far)) {
      float light = kept(far - mean(near, at, factors.x), 0.55, 0.35)
        * kept(far - mean(wide, at, factors.y), 0.5, 1.0);
      // shadows of cloth are warm, because light passes through it
      one.rgb *= pow(vec3(light), 2.2 * vec3(0.92, 1.0, 1.06));
    }
    color += one;
  }
  color /= float(fine * fine);
  vec3 shown = mix(below, above, gl_FragCoord.y / size.y);
  if (color.a > 0.0) shown = encoded(color.rgb + decoded(shown) * (1.0 - color.a));
  float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  pixel = vec4(shown + (noise - 0.5) / 255.0, 1.0);
}`;

/** Draws the arrays of a page; a new one is made after the browser has lost its WebGL context. */
class Drawing {
  constructor(canvas, content, arrays) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false });
    if (!gl) throw new Error("webgl2");
    Object.assign(this, { gl, content, arrays, count: arrays.points.length / 3 });
    // Folds of anything but cloth, whose light is known, are darkened by their depth.
    this.shades = content.sight.shadows && !content.far && gl.getExtension("EXT_color_buffer_float") !== null;
    this.surface = this.program(VERTEX, fragment(content), ["at"]);
    this.coarser = this.program(WHOLE, COARSER);
    this.blur = this.program(WHOLE, BLUR);
    this.compose = this.program(WHOLE, compose(content));
    this.none = gl.createVertexArray();
    this.fill();
    this.far = content.far ? new FarCloth(this, content, arrays) : null;
  }

  program(vertex, fragment, kept = []) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
        throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    if (kept.length) gl.transformFeedbackVaryings(program, kept, gl.SEPARATE_ATTRIBS);
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(gl.getProgramInfoLog(program));
    const names = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS), places = {};
    for (let i = 0; i < names; i++) {
      const { name } = gl.getActiveUniform(program, i);
      places[name] = gl.getUniformLocation(program, name);
    }
    return { program, places };
  }

  /** Copy the arrays to the GPU. */
  fill() {
    const { gl, arrays, content } = this;
    this.vertices = gl.createVertexArray();
    gl.bindVertexArray(this.vertices);
    const kinds = { Int16Array: gl.SHORT, Int32Array: gl.INT, Uint8Array: gl.UNSIGNED_BYTE };
    [arrays.points, arrays.normals, arrays.colors, arrays.values, arrays.exposures].forEach((values, place) => {
      if (!values) return place === 4 && gl.vertexAttrib1f(place, 1); // all is exposed
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      const kind = kinds[values.constructor.name];
      gl.vertexAttribPointer(place, values.length / this.count, kind, kind === gl.UNSIGNED_BYTE, 0, 0);
      gl.enableVertexAttribArray(place);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, arrays.triangles, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    this.shapes = this.layers(arrays.targets, 3);
    this.turns = this.layers(arrays.normal_targets, 3);
    this.changes = this.layers(arrays.changes, 1);
    this.weights = this.texture(gl.TEXTURE_2D);
    this.ramp = this.texture(gl.TEXTURE_2D, gl.LINEAR);
    const colors = (content.numbers?.ramp ?? ["#000000", "#ffffff"]).map(rgb), row = [];
    for (let i = 0; i < 256; i++) {
      const share = (i / 255) * (colors.length - 1), low = Math.min(share | 0, colors.length - 2);
      const parts = [0, 1, 2].map((c) => colors[low][c] * (1 + low - share) + colors[low + 1][c] * (share - low));
      row.push(...parts.map((part) => Math.round(255 * part)), 255);
    }
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(row));
  }

  texture(target, filter = this.gl.NEAREST) {
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(target, texture);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(target, side, filter);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T])
      gl.texParameteri(target, side, gl.CLAMP_TO_EDGE);
    return texture;
  }

  /** Return a texture with a layer for each shape and a texel for each point. */
  layers(values, parts) {
    const gl = this.gl, texture = this.texture(gl.TEXTURE_2D_ARRAY);
    const count = values ? values.length / parts / this.count : 0;
    const long = values instanceof Int32Array;
    const kind = { 1: long ? gl.R32I : gl.R16I, 3: long ? gl.RGB32I : gl.RGB16I }[parts];
    const format = parts === 1 ? gl.RED_INTEGER : gl.RGB_INTEGER, type = long ? gl.INT : gl.SHORT;
    const rows = count ? Math.ceil(this.count / ACROSS) : 1, across = count ? ACROSS : 1;
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, kind, across, rows, Math.max(count, 1));
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    const whole = Math.floor(this.count / ACROSS), left = this.count - whole * ACROSS;
    for (let k = 0; k < count; k++) {
      const own = values.subarray(k * this.count * parts, (k + 1) * this.count * parts);
      const put = (row, width, height, from) => gl.texSubImage3D(
        gl.TEXTURE_2D_ARRAY, 0, 0, row, k, width, height, 1, format, type, own, from);
      if (whole) put(0, ACROSS, whole, 0);
      if (left) put(whole, left, 1, whole * ACROSS * parts);
    }
    return texture;
  }

  /** Set the weight of each shape, and of each change of the numbers. */
  weigh(shapes, changes) {
    const gl = this.gl, width = Math.max(shapes.length, changes.length, 1);
    const table = new Float32Array(2 * width);
    table.set(shapes);
    table.set(changes, width);
    gl.bindTexture(gl.TEXTURE_2D, this.weights);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, width, 2, 0, gl.RED, gl.FLOAT, table);
    this.counts = [shapes.length, changes.length];
    this.far?.move(shapes, changes);
  }

  /** Return a camera together with the depth from which on cloth is a sheet, and what it shows. */
  choose(camera) {
    if (!this.far) return { ...camera, limit: Infinity, yarns: true, sheet: false };
    const { spacing, leastPixels } = this.content.far, { flat } = camera;
    const [nearest, farthest] = this.far.depths(camera);
    // Pixels from yarn to yarn, times the depth if near things look larger.
    const reach = spacing * camera.scale * (flat ? 1 : camera.distance);
    const yarns = leastPixels !== null && reach >= leastPixels * (flat ? 1 : nearest);
    // An edge between yarns and sheet would show, so yarns that go far back become finer first.
    const limit = !yarns ? -1e30 : flat ? 1e30 : reach / FINEST;
    return { ...camera, limit, yarns, sheet: farthest > limit };
  }

  /** Use the surface's program, and set all of its uniforms except those of the camera. */
  begin() {
    const { gl, content } = this, { program, places } = this.surface;
    gl.useProgram(program);
    gl.bindVertexArray(this.vertices);
    this.bind(places, { shapes: this.shapes, turns: this.turns, changes: this.changes }, gl.TEXTURE_2D_ARRAY, 0);
    this.bind(places, { weights: this.weights, ramp: this.ramp }, gl.TEXTURE_2D, 3);
    gl.uniform2i(places.counts, ...this.counts);
    gl.uniform3fv(places.middle, content.middle);
    gl.uniform1f(places.unit, content.unit);
    gl.uniform1i(places.smoothly, this.arrays.normals ? 1 : 0);
    gl.uniform1i(places.scaled, content.numbers ? 1 : 0);
    if (content.numbers) gl.uniform2fv(places.span, this.span);
    return places;
  }

  /** The range of the numbers, in their unit. */
  get span() {
    const { span, unit } = this.content.numbers;
    return span.map((end) => end / unit);
  }

  bind(places, textures, target, first) {
    const gl = this.gl;
    Object.entries(textures).forEach(([name, texture], i) => {
      gl.activeTexture(gl.TEXTURE0 + first + i);
      gl.bindTexture(target, texture);
      gl.uniform1i(places[name], first + i);
    });
  }

  /** Return the positions of all points as they are drawn, in m: x, y, z, one after another. */
  points() {
    const gl = this.gl, found = new Float32Array(3 * this.count), buffer = gl.createBuffer();
    gl.bindBuffer(gl.TRANSFORM_FEEDBACK_BUFFER, buffer);
    gl.bufferData(gl.TRANSFORM_FEEDBACK_BUFFER, found.byteLength, gl.STREAM_READ);
    gl.bindBuffer(gl.TRANSFORM_FEEDBACK_BUFFER, null);
    this.begin();
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, buffer);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, this.count);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    gl.bindBuffer(gl.TRANSFORM_FEEDBACK_BUFFER, buffer);
    gl.getBufferSubData(gl.TRANSFORM_FEEDBACK_BUFFER, 0, found);
    gl.deleteBuffer(buffer);
    return found;
  }

  /** Make the framebuffers, `fine` times as wide and high as the canvas. */
  resize(fine) {
    const gl = this.gl, width = fine * gl.canvas.width, height = fine * gl.canvas.height;
    if (this.size?.[0] === width && this.size[1] === height && this.fine === fine) return;
    Object.assign(this, { size: [width, height], fine });
    this.drop?.();
    const samples = fine > 1 ? 0 : Math.min(4, gl.getParameter(gl.MAX_SAMPLES));
    const made = [];
    const target = (attach) => {
      const frame = gl.createFramebuffer();
      gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
      attach();
      made.push(() => gl.deleteFramebuffer(frame));
      return frame;
    };
    const sampled = (kind, place) => {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, kind, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffer);
      made.push(() => gl.deleteRenderbuffer(buffer));
    };
    const plain = (kind, place, across = width, up = height) => {
      const texture = this.texture(gl.TEXTURE_2D);
      gl.texStorage2D(gl.TEXTURE_2D, 1, kind, across, up);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, place, gl.TEXTURE_2D, texture, 0);
      made.push(() => gl.deleteTexture(texture));
      return texture;
    };
    const image = gl.COLOR_ATTACHMENT0, deep = gl.DEPTH_ATTACHMENT;
    this.sampled = target(() => { sampled(gl.SRGB8_ALPHA8, image); sampled(gl.DEPTH_COMPONENT24, deep); });
    this.plain = target(() => { this.drawn = plain(gl.SRGB8_ALPHA8, image); this.depth = plain(gl.DEPTH_COMPONENT24, deep); });
    this.coarse = (factor) => {
      const half = [Math.ceil(width / factor), Math.ceil(height / factor)];
      return [0, 1].map(() => {
        const found = { size: half };
        found.frame = target(() => { found.image = plain(gl.RG32F, image, ...half); });
        return found;
      });
    };
    this.kept = {};
    this.drop = () => made.forEach((each) => each());
  }

  /**
   * Draw for a camera with `eye`, `lens`, `flat`, `range`, the pixels of a fold, and the `limit` and
   * `parts` of `choose`.
   */
  draw(camera, below, above) {
    const gl = this.gl, [width, height] = this.size;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.sampled);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.enable(gl.DEPTH_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const places = this.begin();
    gl.uniformMatrix4fv(places.eye, false, camera.eye);
    gl.uniformMatrix4fv(places.lens, false, camera.lens);
    gl.uniform1i(places.flat_, camera.flat);
    gl.uniform1f(places.point, this.fine * camera.point);
    const all = this.arrays.triangles.length, yarns = this.far ? 3 * this.content.far.triangles : 0;
    const surface = (first, count, limit) => {
      gl.uniform1f(places.limit, limit);
      if (count) gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
    };
    // Where yarns and sheet meet, the nearer one is visible.
    if (camera.yarns) surface(0, yarns, camera.limit + this.content.sight.relief);
    surface(yarns, all - yarns, 1e30);
    if (camera.sheet) this.far.draw(camera, below, above, this.fine, this.ramp);
    gl.disable(gl.DEPTH_TEST);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.sampled);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, this.plain);
    const copied = gl.COLOR_BUFFER_BIT | (this.shades ? gl.DEPTH_BUFFER_BIT : 0);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, copied, gl.NEAREST);
    gl.bindVertexArray(this.none);
    const shades = this.shades ? [0.35, 1.0].map((radius, i) => this.surroundings(i, radius * this.fine * camera.fold, camera)) : [];
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    const pass = this.pass(this.compose, { drawn: this.drawn, depth: this.depth, near: shades[0]?.image ?? this.drawn, wide: shades[1]?.image ?? this.drawn }, camera);
    gl.uniform1i(pass.dimmed, shades.length);
    gl.uniform2f(pass.factors, shades[0]?.factor ?? 1, shades[1]?.factor ?? 1);
    gl.uniform2f(pass.size, gl.canvas.width, gl.canvas.height);
    gl.uniform1i(pass.fine, this.fine);
    gl.uniform3fv(pass.below, below);
    gl.uniform3fv(pass.above, above);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** Return the mean depth around each pixel at lower resolution, which is enough when blurred. */
  surroundings(which, spread, camera) {
    const gl = this.gl;
    let factor = 2;
    while (spread >= 6 * factor && factor < 64) factor *= 2;
    if (this.kept[which]?.factor !== factor) this.kept[which] = { factor, pair: this.coarse(factor) };
    const [one, other] = this.kept[which].pair, sigma = Math.max(0.7, spread / factor);
    const into = (target) => {
      gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
      gl.viewport(0, 0, ...target.size);
    };
    into(one);
    gl.uniform1i(this.pass(this.coarser, { depth: this.depth }, camera).factor, factor);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    for (const [from, to, along] of [[one, other, [1, 0]], [other, one, [0, 1]]]) {
      into(to);
      const places = this.pass(this.blur, { image: from.image }, camera);
      gl.uniform2i(places.along, ...along);
      gl.uniform1f(places.sigma, sigma);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    return { image: one.image, factor };
  }

  pass({ program, places }, textures, camera) {
    const gl = this.gl;
    gl.useProgram(program);
    this.bind(places, textures, gl.TEXTURE_2D, 0);
    gl.uniform4f(places.range, ...camera.range, camera.distance, this.content.sight.relief);
    gl.uniform1i(places.flat_, camera.flat);
    return places;
  }
}

/** Convert "#rrggbb" to red, green and blue from 0 to 1. */
function rgb(color) {
  return [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16) / 255);
}
