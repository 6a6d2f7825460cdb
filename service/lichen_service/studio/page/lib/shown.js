// Samples made visible: colours as they are, data stretched to its range, a vector's direction as hue and its length as
// brightness. NaN is magenta and infinity is cyan. The thumbnails of the catalogue are made by the same rules.

const encode = (light) => (light <= 0.0031308 ? 12.92 * light : 1.055 * light ** (1 / 2.4) - 0.055);
const clamp = (value) => (value < 0 ? 0 : value > 1 ? 1 : value);

// { pictures: an ImageData for each page, range: [low, high] over all pages, or null where nothing was stretched }
export function shown({ width, height, channels, pages = 1, data }, { space = "data", alpha = "none" } = {}) {
  const colours = channels - (alpha === "none" ? 0 : 1);
  const range = space === "data" && colours !== 2 ? stretch(data, channels, colours) : null;
  const pixel = colours === 2 ? vector(data, channels) : colour(space, colours, range);
  const pictures = Array.from({ length: pages }, () => new ImageData(width, height));
  let from = 0;
  for (const { data: out } of pictures) {
    for (let i = 0; i < out.length; i += 4, from += channels) {
      pixel(data, from, out, i);
      out[i + 3] = alpha === "none" ? 255 : 255 * clamp(data[from + channels - 1]);
      spoilt(data, from, colours, out, i);
    }
  }
  return { pictures, range };
}

function stretch(data, channels, colours) {
  let low = Infinity;
  let high = -Infinity;
  for (let i = 0; i < data.length; i += 1) {
    const value = data[i];
    if (i % channels >= Math.min(colours, 3) || !Number.isFinite(value)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return (low >= 0 && high <= 1 && high - low > 0.1) || low > high ? null : [low, high];
}

function colour(space, colours, range) {
  const [low, size] = range ? [range[0], range[1] - range[0] || 1] : [0, 1];
  const flat = range && range[0] === range[1];
  const at = (value) => 255 * (space === "linear" ? encode(clamp(value)) : flat ? 0.5 : clamp((value - low) / size));
  const [green, blue] = colours >= 3 ? [1, 2] : [0, 0];
  return (data, from, out, i) => {
    out[i] = at(data[from]);
    out[i + 1] = at(data[from + green]);
    out[i + 2] = at(data[from + blue]);
  };
}

function vector(data, channels) {
  let longest = 0;
  for (let i = 0; i < data.length; i += channels) {
    const length = Math.hypot(data[i], data[i + 1]);
    if (Number.isFinite(length) && length > longest) longest = length;
  }
  return (data, from, out, i) => {
    const [x, y] = [data[from], data[from + 1]];
    const turn = (Math.atan2(y, x) / (2 * Math.PI)) * 6;
    const bright = Math.sqrt(Math.hypot(x, y) / (longest || 1));
    [0, 4, 2].forEach((shift, c) => {
      const hue = clamp(Math.abs(((((turn + shift) % 6) + 6) % 6) - 3) - 1);
      out[i + c] = 255 * (0.12 + 0.88 * hue * bright);
    });
  };
}

function spoilt(data, from, colours, out, i) {
  let infinite = false;
  for (let c = 0; c < colours; c += 1) {
    const value = data[from + c];
    if (Number.isNaN(value)) return ([out[i], out[i + 1], out[i + 2], out[i + 3]] = [255, 0, 255, 255]);
    if (!Number.isFinite(value)) infinite = true;
  }
  if (infinite) [out[i], out[i + 1], out[i + 2], out[i + 3]] = [0, 255, 255, 255];
}
