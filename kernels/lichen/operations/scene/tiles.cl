// Bounds of what every tile shows: low and high of its finite points, low and high of their normals, and how much is
// spoilt; a tile of TILE px to a work-item. tiles.py is the definition.
//
// Rows of three channels are read as they lie, eight numbers at a time: three loads hold the same channels at the same
// places, so each has bounds of its own, which are taken apart once for a tile.
#define TILE 32
#define LANES 8
#define BOUNDS 16
#define PHASES 3
#define FN static inline __attribute__((always_inline))

typedef struct { float8 low[PHASES], high[PHASES], least[PHASES], most[PHASES]; } Bounds;

FN void take(Bounds *b, int phase, float8 p, float8 n, int8 *spoilt)
{
    int8 there = fabs(p) < INFINITY; // of what is spoilt no bounds are needed
    b->low[phase] = (there & (p < b->low[phase])) ? p : b->low[phase];
    b->high[phase] = (there & (p > b->high[phase])) ? p : b->high[phase];
    b->least[phase] = (there & (n < b->least[phase])) ? n : b->least[phase];
    b->most[phase] = (there & (n > b->most[phase])) ? n : b->most[phase];
    *spoilt |= (p != p) | !(fabs(n) < INFINITY);
}

FN float8 first_three(global const float *restrict in, float rest)
{
    float8 v = (float8)(rest);
    v.s012 = vload3(0, in);
    return v;
}

FN void spread(const float8 *v, int larger, global float *restrict out)
{
    float lane[PHASES * LANES], found[3];
    for (int k = 0; k < PHASES; k++)
        vstore8(v[k], k, lane);
    for (int c = 0; c < 3; c++)
        found[c] = lane[c];
    for (int k = 3; k < PHASES * LANES; k++)
        found[k % 3] = larger == (lane[k] > found[k % 3]) ? lane[k] : found[k % 3];
    for (int c = 0; c < 3; c++)
        out[c] = found[c];
}

kernel void bounds(global const float *restrict position, global const float *restrict normal, global float *restrict out,
                   int width, int height, int across, int tiles, int column, int row, int step)
{
    int tile = (int)get_global_id(0); // of those that are taken: every `step`th from a column and a row on
    if (tile >= tiles)
        return;
    int left = (tile % across * step + column) * TILE, top = (tile / across * step + row) * TILE;
    int wide = min(width - left, TILE), bottom = min(top + TILE, height);
    Bounds b;
    for (int k = 0; k < PHASES; k++) {
        b.low[k] = b.least[k] = (float8)(INFINITY);
        b.high[k] = b.most[k] = (float8)(-INFINITY);
    }
    int8 spoilt = 0;
    for (int y = top; y < bottom; y++) {
        ulong first = ((ulong)y * width + left) * 3;
        global const float *p = position + first, *n = normal + first;
        if (wide == TILE) {
            for (int k = 0; k < TILE / LANES; k++, p += PHASES * LANES, n += PHASES * LANES) {
                take(&b, 0, vload8(0, p), vload8(0, n), &spoilt);
                take(&b, 1, vload8(1, p), vload8(1, n), &spoilt);
                take(&b, 2, vload8(2, p), vload8(2, n), &spoilt);
            }
        } else
            for (int at = 0; at < wide; at++)
                take(&b, 0, first_three(p + 3 * at, INFINITY), first_three(n + 3 * at, 0.0f), &spoilt);
    }
    out += (ulong)tile * BOUNDS;
    spread(b.low, 0, out);
    spread(b.high, 1, out + 3);
    spread(b.least, 0, out + 6);
    spread(b.most, 1, out + 9);
    out[12] = any(spoilt) ? 1.0f : 0.0f;
}
