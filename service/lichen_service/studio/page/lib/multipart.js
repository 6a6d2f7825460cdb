// multipart/mixed taken apart (RFC 2046): [{ headers: Map, body: Uint8Array }].

export function parts(contentType, buffer) {
  const boundary = /boundary="?([^";]+)"?/.exec(contentType)?.[1];
  if (!boundary) throw new Error("The answer names no boundary between its parts.");
  const bytes = new Uint8Array(buffer);
  const mark = new TextEncoder().encode(`--${boundary}`);
  const found = [];
  let at = find(bytes, mark, 0);
  while (at >= 0) {
    const start = at + mark.length;
    const end = find(bytes, mark, start);
    if (end < 0) break;
    found.push(part(bytes.subarray(start + 2, end - 2)));
    at = end;
  }
  return found;
}

function part(bytes) {
  const gap = find(bytes, new Uint8Array([13, 10, 13, 10]), 0);
  const lines = new TextDecoder("latin1").decode(bytes.subarray(0, gap)).split("\r\n");
  const headers = new Map();
  for (const line of lines) {
    const colon = line.indexOf(":");
    if (colon > 0) headers.set(line.slice(0, colon).toLowerCase(), line.slice(colon + 1).trim());
  }
  return { headers, body: bytes.subarray(gap + 4) };
}

function find(bytes, wanted, from) {
  for (let i = bytes.indexOf(wanted[0], from); i >= 0; i = bytes.indexOf(wanted[0], i + 1)) {
    let j = 1;
    while (j < wanted.length && bytes[i + j] === wanted[j]) j += 1;
    if (j === wanted.length) return i;
  }
  return -1;
}
