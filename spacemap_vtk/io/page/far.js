// Draw woven cloth as a sheet where its yarns are too thin to be seen, with the shaders of pictures.

const STRIP = 12; // columns of cells that are drawn together: points are lit once if they come again soon

const farVertex = ({ light, far }) => `#version 300 es
precision highp float; precision highp int; precision highp sampler2D;
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 warp;
layout(location = 2) in vec3 weft;
layout(location = 3) in vec2 texel;
layout(location = 4) in float value;
uniform mat4 eye, lens;
uniform float shaded;
out vec2 coordinates;
out float number, depth;
${light}${far.vertex}
void main() {
  vec4 there = eye * vec4(place, 1.0);
  gl_Position = lens * there;
  coordinates = texel;
  number = value;
  depth = -there.z;
  lightYarns(there.xyz, gl_Position, normalize(mat3(eye) * warp), normalize(mat3(eye) * weft));
}`;

const farFragment = ({ light, far }) => `#version 300 es
precision highp float; precision highp int; precision highp sampler2D;
in vec2 coordinates;
in float number, depth;
uniform sampler2D warpFront, weftFront, warpBack, weftBack, tileNumbers, tiles, ramp;
uniform vec2 crossings, mixing, span;
uniform vec3 below, above;
uniform vec4 hole;
uniform float shaded, grain, limit;
uniform int averaged;
uniform bool scaled;
out vec4 pixel;
${light}${far.fragment}
void main() {
  vec3 hue = vec3(1);
  if (scaled) {
    float share = clamp((number - span.x) / (span.y - span.x), 0.0, 1.0);
    hue = texture(ramp, vec2(0.5 / 256.0 + share * 255.0 / 256.0, 0.5)).rgb;
  }
  vec3 shown = sheetLight(coordinates, hue);
  if (depth < limit) discard; // after the derivatives
  pixel = vec4(shown, 1.0);
}`;

/** A woven cloth as a sheet. It has few points, so the processor adds up its shapes. */
class FarCloth {
  constructor(drawing, content, arrays) {
    const { gl } = drawing, { far } = content;
    Object.assign(this, { drawing, gl, content, arrays, far, columns: far.columns.length, rows: far.rows.length });
    this.program = drawing.program(farVertex(content), farFragment(content));
    const count = (this.count = this.columns * this.rows);
    this.places = new Float32Array(3 * count);
    this.numbers = new Float32Array(count);
    this.directions = [new Float32Array(3 * count), new Float32Array(3 * count)];
    const texels = far.rows.flatMap((t) => far.columns.flatMap((s) => [s, t]));
    const corners = [];
    for (let strip = 1; strip < this.columns; strip += STRIP)
      for (let row = 1; row < this.rows; row++)
        for (let column = strip; column < Math.min(strip + STRIP, this.columns); column++) {
          const last = row * this.columns + column, [first, right, up] = [last - this.columns - 1, last - this.columns, last - 1];
          corners.push(first, right, last, first, last, up);
        }
    this.corners = corners.length;
    this.vertices = gl.createVertexArray();
    gl.bindVertexArray(this.vertices);
    this.buffers = [3, 3, 3, 2, 1].map((width, place) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      if (place === 3) gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(texels), gl.STATIC_DRAW);
      gl.vertexAttribPointer(place, width, gl.FLOAT, false, 0, 0);
      gl.enableVertexAttribArray(place);
      return buffer;
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(corners), gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    this.textures = {};
    const colors = ["warpFront", "weftFront", "warpBack", "weftBack"];
    for (const name of colors) this.textures[name] = this.texture(name, gl.SRGB8_ALPHA8, gl.RGBA, far.levels);
    this.textures.tiles = this.texture("tiles", gl.RGBA8, gl.RGBA, far.tileLevels);
    this.textures.tileNumbers = this.texture("tileNumbers", gl.RGB8, gl.RGB, 0);
    const views = Float32Array.from(arrays.views, (each) => each * far.viewUnit);
    this.textures.views = this.texture("views", gl.RGBA32F, gl.RGBA, 0, views);
  }

  /** Return the texture of an array, with some mip levels: means of 2 x 2 texels, in linear light. */
  texture(name, kind, format, levels, values = this.arrays[name]) {
    const { gl } = this, [rows, columns] = this.content.arrays.find((each) => each.name === name).shape;
    const texture = this.drawing.texture(gl.TEXTURE_2D);
    gl.texStorage2D(gl.TEXTURE_2D, levels + 1, kind, columns, rows);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, columns, rows, format, values.BYTES_PER_ELEMENT === 1 ? gl.UNSIGNED_BYTE : gl.FLOAT, values);
    if (levels) {
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST_MIPMAP_NEAREST);
      gl.generateMipmap(gl.TEXTURE_2D);
    }
    return texture;
  }

  /** Move all points by the weights of the shapes, and their numbers by those of the changes. */
  move(weights, changes) {
    const { gl, content, arrays, places, count, columns } = this;
    addShapes(places, arrays.far_points, arrays.far_targets, weights);
    for (let i = 0; i < places.length; i++) places[i] = content.middle[i % 3] + content.unit * places[i];
    // The warp runs from row to row, the weft from column to column.
    this.directions.forEach((along, way) => {
      const step = way ? 1 : columns, ends = way ? columns : this.rows;
      for (let i = 0; i < count; i++) {
        const position = way ? i % columns : Math.floor(i / columns);
        const before = 3 * (position ? i - step : i), after = 3 * (position < ends - 1 ? i + step : i);
        for (let axis = 0; axis < 3; axis++) along[3 * i + axis] = places[after + axis] - places[before + axis];
      }
    });
    const filled = [places, ...this.directions];
    if (arrays.far_values) {
      addShapes(this.numbers, arrays.far_values, arrays.far_changes, changes);
      filled[4] = this.numbers;
    }
    filled.forEach((values, place) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[place]);
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
    });
    if (!arrays.far_values) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[4]);
      gl.bufferData(gl.ARRAY_BUFFER, this.numbers, gl.DYNAMIC_DRAW);
    }
  }

  /** Return the least and the largest depth of the points in a camera's view; of all if none is. */
  depths({ eye, lens, flat }) {
    const { places } = this, found = [Infinity, -Infinity], all = [Infinity, -Infinity];
    const widen = (range, depth) => {
      range[0] = Math.min(range[0], depth);
      range[1] = Math.max(range[1], depth);
    };
    for (let i = 0; i < places.length; i += 3) {
      const [x, y, z] = [0, 1, 2].map((k) => eye[k] * places[i] + eye[4 + k] * places[i + 1] + eye[8 + k] * places[i + 2] + eye[12 + k]);
      const beyond = flat ? 1.2 : 1.2 * Math.abs(z);
      widen(all, -z);
      if (Math.abs(lens[0] * x + lens[8] * z + lens[12]) <= beyond && Math.abs(lens[5] * y + lens[9] * z + lens[13]) <= beyond) widen(found, -z);
    }
    return found[0] <= found[1] ? found : all;
  }

  /** Draw what is farther than the camera's limit, `fine` samples for each pixel of the canvas. */
  draw(camera, below, above, fine, ramp) {
    const { gl, drawing, content } = this, { program, places } = this.program;
    gl.useProgram(program);
    gl.bindVertexArray(this.vertices);
    drawing.bind(places, { ...this.textures, ramp }, gl.TEXTURE_2D, 0);
    for (const [name, value] of Object.entries(content.far.uniforms)) {
      if (name === "averaged") gl.uniform1i(places[name], value);
      else gl[`uniform${value.length ?? 1}fv`](places[name], [value].flat());
    }
    gl.uniformMatrix4fv(places.eye, false, camera.eye);
    gl.uniformMatrix4fv(places.lens, false, camera.lens);
    gl.uniform3fv(places.below, below);
    gl.uniform3fv(places.above, above);
    gl.uniform1f(places.grain, fine);
    gl.uniform1f(places.limit, camera.limit);
    gl.uniform1i(places.scaled, content.numbers ? 1 : 0);
    if (content.numbers) gl.uniform2fv(places.span, drawing.span);
    gl.drawElements(gl.TRIANGLES, this.corners, gl.UNSIGNED_INT, 0);
  }
}

/** Fill values with a base and the sum of some shapes of the same length. */
function addShapes(values, base, shapes, weights) {
  values.set(base);
  weights.forEach((weight, k) => {
    const first = k * values.length;
    if (weight) for (let i = 0; i < values.length; i++) values[i] += weight * shapes[first + i];
  });
}
