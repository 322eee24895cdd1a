// Read the data of the page: arrays of integers, and the weight of each shape over time.

/** Parse the JSON in an element of the page. */
function readJson(id) {
  return JSON.parse(document.getElementById(id).textContent);
}

/** Stream the bytes of the page's data elements; each element is removed when it is read. */
function readPageBytes() {
  const parts = [...document.querySelectorAll("script.data")];
  return new ReadableStream({
    pull(stream) {
      const part = parts.shift();
      if (!part) return stream.close();
      const text = atob(part.textContent);
      part.remove();
      const bytes = new Uint8Array(text.length);
      for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
      stream.enqueue(bytes);
    },
  });
}

const KINDS = { u1: Uint8Array, i2: Int16Array, i4: Int32Array, u4: Uint32Array };

/** Return the arrays of the page by name. */
async function unpack(described) {
  const found = {};
  const reader = readPageBytes().pipeThrough(new DecompressionStream("deflate-raw")).getReader();
  let rest = new Uint8Array(0);
  for (const { name, kind, shape } of described) {
    const width = KINDS[kind].BYTES_PER_ELEMENT;
    const bytes = new Uint8Array(width * shape.reduce((size, n) => size * n, 1));
    for (let filled = 0; filled < bytes.length; ) {
      if (!rest.length) {
        const { value, done } = await reader.read();
        if (done) throw new Error("the page is cut off: save it again, whole");
        rest = value;
      }
      const some = rest.subarray(0, bytes.length - filled);
      bytes.set(some, filled);
      filled += some.length;
      rest = rest.subarray(some.length);
    }
    found[name] = sumColumns(bytes, KINDS[kind], shape);
  }
  return found;
}

/**
 * Return rows of numbers. The data hold the differences from row to row of each column: first the
 * first bytes of all differences, then the second bytes.
 */
function sumColumns(bytes, Kind, shape) {
  const width = Kind.BYTES_PER_ELEMENT, total = bytes.length / width;
  const columns = shape.at(-1), rows = shape.at(-2), values = new Kind(total);
  for (let run = 0; rows && run < total / rows; run++) {
    const first = Math.floor(run / columns) * rows * columns + (run % columns);
    for (let row = 0, at = run * rows, sum = 0; row < rows; row++, at++) {
      let step = bytes[at];
      for (let byte = 1; byte < width; byte++) step |= bytes[at + byte * total] << (8 * byte);
      sum = (sum + step) | 0;
      values[first + row * columns] = sum; // values wrap around, as the encoder expects
    }
  }
  return values;
}

/** Interpolate each column linearly at a time, which is limited to the first and the last. */
function weightsAt(times, rows, time) {
  if (!rows.length || !rows[0].length) return [];
  let after = times.findIndex((each) => each > time);
  if (after < 0) after = times.length - 1;
  const before = Math.max(after - 1, 0), length = times[after] - times[before];
  const share = length > 0 ? Math.min(Math.max((time - times[before]) / length, 0), 1) : 0;
  return rows[before].map((weight, k) => weight + share * (rows[after][k] - weight));
}
