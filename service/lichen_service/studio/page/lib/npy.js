// NumPy's file format, version 1 to 3, read: the samples of a result as the floats they are.
// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html

const ARRAYS = { "<f4": Float32Array, "<f8": Float64Array, "|u1": Uint8Array, "<u2": Uint16Array };
const SCALES = { "|u1": 255, "<u2": 65535 };

// { width, height, channels, pages, data }, where pages of this height follow one another; integers become numbers in
// [0, 1], as the service reads them.
export function read(buffer) {
  const view = new DataView(buffer);
  if (view.getUint8(0) !== 0x93 || view.getUint8(6) < 1) throw new Error("This is no NPY file.");
  const wide = view.getUint8(6) > 1;
  const length = wide ? view.getUint32(8, true) : view.getUint16(8, true);
  const start = wide ? 12 : 10;
  const header = new TextDecoder().decode(new Uint8Array(buffer, start, length));
  const descr = /'descr':\s*'([^']+)'/.exec(header)[1];
  const shape = /'shape':\s*\(([^)]*)\)/
    .exec(header)[1]
    .split(",")
    .filter((each) => each.trim())
    .map(Number);
  if (/'fortran_order':\s*True/.test(header)) throw new Error("Columns first is not read here.");
  const pages = shape.length > 3 ? shape.shift() : 1;
  const [height, width, channels] = [shape[0], shape[1] ?? 1, shape[2] ?? 1];
  const data = samples(buffer.slice(start + length), descr);
  return { width, height, channels, pages, data };
}

function samples(buffer, descr) {
  if (descr === "<f2") return Float32Array.from(new Uint16Array(buffer), half);
  if (!(descr in ARRAYS)) throw new Error(`Samples of type ${descr} are not read here.`);
  const data = new ARRAYS[descr](buffer);
  return descr in SCALES ? Float32Array.from(data, (each) => each / SCALES[descr]) : data;
}

function half(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const power = (bits >> 10) & 31;
  const rest = bits & 1023;
  if (power === 31) return rest ? NaN : sign * Infinity;
  return sign * (power ? 2 ** (power - 15) * (1 + rest / 1024) : 2 ** -14 * (rest / 1024));
}
