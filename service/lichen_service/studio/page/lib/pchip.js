// The curve through points as the service has it: cubic pieces that keep the points' order (F. N. Fritsch and J. Butland,
// 1984), or straight lines; beyond the ends their values, or straight on.

const EVERY = 64; // places for the whole width

// [[x, y]] from x = 0 to x = 1, for points whose x ascend.
export function curved(points, { straight = false, extend = false } = {}) {
  const slopes = straight || points.length < 3 ? null : slopesOf(points);
  const end = (at, inner, x) => {
    const [x0, y0] = points[at];
    const chord = (points[inner][1] - y0) / (points[inner][0] - x0);
    return y0 + (extend ? (slopes ? slopes[at] : chord) * (x - x0) : 0);
  };
  const last = points.length - 1;
  const places = [...Array(EVERY + 1).keys()].map((i) => i / EVERY).concat(points.map(([x]) => x));
  places.sort((a, b) => a - b);
  return places.map((x) => {
    if (x <= points[0][0]) return [x, end(0, 1, x)];
    if (x >= points[last][0]) return [x, end(last, last - 1, x)];
    const k = points.findIndex((each) => each[0] > x) - 1;
    return [x, piece(points[k], points[k + 1], slopes?.[k], slopes?.[k + 1], x)];
  });
}

function piece([x0, y0], [x1, y1], from, to, x) {
  const [width, t] = [x1 - x0, x - x0];
  const chord = (y1 - y0) / width;
  if (from === undefined) return y0 + chord * t;
  const c = (3 * chord - 2 * from - to) / width;
  const d = (from - 2 * chord + to) / width ** 2;
  return y0 + t * (from + t * (c + t * d));
}

function slopesOf(points) {
  const width = points.slice(1).map(([x], i) => x - points[i][0]);
  const chord = points.slice(1).map(([, y], i) => (y - points[i][1]) / width[i]);
  const last = width.length - 1;
  const inner = chord.slice(1).map((after, i) => {
    const before = chord[i];
    if (before * after <= 0) return 0;
    const [a, b] = [2 * width[i + 1] + width[i], width[i + 1] + 2 * width[i]];
    return (a + b) / (a / before + b / after);
  });
  return [end(width[0], width[1], chord[0], chord[1]), ...inner, end(width[last], width[last - 1], chord[last], chord[last - 1])];
}

// The slope at an end, from the chords of the two pieces nearest to it.
function end(near, far, chord, next) {
  const slope = ((2 * near + far) * chord - near * next) / (near + far);
  if (Math.sign(slope) !== Math.sign(chord)) return 0;
  return Math.sign(chord) !== Math.sign(next) && Math.abs(slope) > 3 * Math.abs(chord) ? 3 * chord : slope;
}
