/* Line integral convolution by whole pixels: Euler steps through the vectors of pixels, reading texels as they are, one
 * channel of the texture at a time.
 *
 * As in lic.cl, one work-item follows a SEGMENT of neighbouring pixels. Built with SAME (whether texture and field are of
 * one size) and ARC (whether lines go by arc length).
 */

#include "field.clh"

inline int whole_texel(float x, float scale, int size) {
    return min((int)(x * scale), size - 1);
}

#if ARC
/* Steps of one length fit into two numbers of 16 bits, and places into whole numbers of as fine a unit: `bits` binary
 * places of a pixel. A cell is then a shift away, and whether a field opposes a step is a sum of two products.
 *
 * What bounds it is fetching, one pixel after the other: AVX2 gathers no faster. So where texture and field are of one
 * size, step and texel lie side by side and come with one load of 64 bits. That and whole numbers took 65 ms to 30, for
 * 1024 x 1024 pixels and 40 steps; a loop apart for lines of which none has ended is a third of it. */
#if SAME
typedef ulong Cell;
#define CELL(step, texel) ((ulong)(uint)(step) | (ulong)as_uint(texel) << 32)
#define TEXEL_OF(cell, x, y) as_float((uint)((cell) >> 32))
#else
typedef uint Cell;
#define CELL(step, texel) (uint)(step)
#define TEXEL_OF(cell, x, y)                                                                                           \
    texture[(whole_texel((float)(y), scale_y, texture_height) * texture_width +                                        \
             whole_texel((float)(x), scale_x, texture_width)) * stride]
#endif
inline int step_x(int s) { return (s << 16) >> 16; }
inline int step_y(int s) { return s >> 16; }

/* `unit` is the length of a step, in the unit of places. */
kernel void prepare(global const float *restrict image, global const float *restrict texture, global Cell *restrict cells,
                    int count, int channels, int stride, int channel, float scale, float bias, float limit, float unit) {
    const int first = get_global_id(0) * SEGMENT;
    float x[SEGMENT], y[SEGMENT];
    int step[SEGMENT];
    vectors_at(x, y, image, first, count, channels, scale, bias, limit);
    EACH {
        const float u = fabs(x[i]), v = fabs(y[i]), m = u > v ? u : v;
        const int moves = (m > 0.0f) & (x[i] == x[i]);
        const float s = power_near(m), along = unit / sqrt(fma(x[i] * s, x[i] * s, y[i] * s * (y[i] * s)));
        const int h = (int)rint(moves ? x[i] * s * along : 0.0f), k = (int)rint(moves ? y[i] * s * along : 0.0f);
        step[i] = (h & 0xffff) | (k << 16);
    }
    for (int i = 0; i < SEGMENT && first + i < count; ++i) cells[first + i] = CELL(step[i], texture[(size_t)(first + i) * stride + channel]);
}

typedef struct {
    int x[SEGMENT], y[SEGMENT], step[SEGMENT], alive[SEGMENT]; /* alive: all bits, or none */
    float own[SEGMENT], sum[SEGMENT], weight[SEGMENT];
} Lines;

/* One step of every line, into the cells where it ends. */
inline void advance(Lines *restrict l, int *restrict to, int way, int width, int bits) {
    EACH {
        const int s = l->step[i];
        l->x[i] += way ? -step_x(s) : step_x(s);
        l->y[i] += way ? -step_y(s) : step_y(s);
        to[i] = (l->y[i] >> bits) * width + (l->x[i] >> bits);
    }
}

/* Ends the lines whose next step would leave the image. */
inline void stop_at_border(Lines *restrict l, int way, uint right, uint bottom) {
    EACH {
        const int s = l->step[i];
        const uint x = l->x[i] + (way ? -step_x(s) : step_x(s)), y = l->y[i] + (way ? -step_y(s) : step_y(s));
        const int stays = x < right && y < bottom ? -1 : 0;
        l->alive[i] &= stays;
        l->step[i] &= stays;
    }
}

kernel void walk(global const Cell *restrict cells, global const float *restrict texture,
                 global const float *restrict weights, global float *restrict result, int width, int height,
                 int texture_width, int texture_height, int stride, int channel, int count, int bits, float reach) {
    const int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height) return;
    const int edge = !(first > reach && first + SEGMENT + reach < width && row > reach && row + 1 + reach < height);
    const float pixel = 1 << bits, scale_x = (float)texture_width / (float)width / pixel, scale_y = (float)texture_height / (float)height / pixel;
    Lines l;
    int to[SEGMENT];
    Cell found[SEGMENT];
    texture += channel;
    EACH l.sum[i] = l.weight[i] = 0.0f;
    for (int way = 0; way < 2; ++way) {
        global const float *along = weights + way * (count + 1);
        int some = 0;
        EACH {
            const int column = min(first + i, width - 1);
            const Cell cell = cells[row * width + column];
            l.x[i] = (column << bits) + (1 << bits >> 1);
            l.y[i] = (row << bits) + (1 << bits >> 1);
            l.step[i] = (int)cell;
            l.alive[i] = l.step[i] ? -1 : 0;
            l.own[i] = TEXEL_OF(cell, l.x[i], l.y[i]);
            l.weight[i] += along[0];
            some |= l.alive[i];
        }
        int k = 1, whole = !edge; /* whether the lines live and stay inside */
        EACH whole &= l.alive[i];
        for (float passed = 0.0f; whole && k <= count; ++k) {
            const float w = along[k];
            advance(&l, to, way, width, bits);
            EACH found[i] = cells[to[i]];
            passed += w;
            int opposed = 0;
            EACH {
                const int s = (int)found[i], now = l.step[i];
                l.sum[i] = fma(w, TEXEL_OF(found[i], l.x[i], l.y[i]) - l.own[i], l.sum[i]);
                l.alive[i] = step_x(s) * step_x(now) + step_y(s) * step_y(now) > 0 ? -1 : 0;
                opposed |= ~l.alive[i];
                l.step[i] = s & l.alive[i];
            }
            if (!opposed && k < count) continue;
            whole = 0;
            EACH l.weight[i] += passed;
        }
        for (; some && k <= count; ++k) {
            const float w = along[k];
            if (edge) stop_at_border(&l, way, width << bits, height << bits);
            advance(&l, to, way, width, bits);
            EACH found[i] = cells[to[i]];
            some = 0;
            EACH {
                const int s = (int)found[i], now = l.step[i];
                const float more = fma(w, TEXEL_OF(found[i], l.x[i], l.y[i]) - l.own[i], l.sum[i]);
                l.sum[i] = l.alive[i] ? more : l.sum[i];
                l.weight[i] += l.alive[i] ? w : 0.0f;
                l.alive[i] &= step_x(s) * step_x(now) + step_y(s) * step_y(now) > 0 ? -1 : 0;
                l.step[i] = s & l.alive[i];
                some |= l.alive[i];
            }
        }
    }
    EACH {
        if (first + i >= width) break;
        result[((size_t)row * width + first + i) * stride + channel] = l.weight[i] > 0.0f ? l.own[i] + l.sum[i] / l.weight[i] : l.own[i];
    }
}
#else
#if SAME
#define TEXEL_AT(x, y, cell) ((cell) * stride)
#else
#define TEXEL_AT(x, y, cell) (whole_texel(y, scale_y, texture_height) * texture_width + whole_texel(x, scale_x, texture_width)) * stride
#endif

/* Steps in time are as long as the vectors, and keep their range; a pair of floats, zero where a line ends. Positions are
 * relative to where a line began. */
kernel void prepare(global const float *restrict image, global const float *restrict texture, global float *restrict steps,
                    int count, int channels, int stride, int channel, float scale, float bias, float limit, float unit) {
    const int first = get_global_id(0) * SEGMENT;
    float x[SEGMENT], y[SEGMENT];
    vectors_at(x, y, image, first, count, channels, scale, bias, limit);
    for (int i = 0; i < SEGMENT && first + i < count; ++i) {
        const int moves = x[i] == x[i];
        vstore2((float2)(moves ? x[i] * unit : 0.0f, moves ? y[i] * unit : 0.0f), first + i, steps);
    }
}

kernel void walk(global const float *restrict steps, global const float *restrict texture,
                 global const float *restrict weights, global float *restrict result, int width, int height,
                 int texture_width, int texture_height, int stride, int channel, int count, int bits, float reach) {
    const int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height) return;
    const int edge = !(first > reach && first + SEGMENT + reach < width && row > reach && row + 1 + reach < height);
    const float fw = width, fh = height, scale_x = (float)texture_width / (float)width, scale_y = (float)texture_height / (float)height;

    int columns[SEGMENT];
    float own[SEGMENT], sum[SEGMENT], weight[SEGMENT], x[SEGMENT], y[SEGMENT], u[SEGMENT], v[SEGMENT], alive[SEGMENT];
    texture += channel;
    for (int way = 0; way < 2; ++way) {
        const float by = way ? -1.0f : 1.0f;
        global const float *along = weights + way * (count + 1);
        EACH {
            columns[i] = min(first + i, width - 1);
            const float2 s = vload2(row * width + columns[i], steps);
            x[i] = y[i] = 0.5f;
            u[i] = s.x;
            v[i] = s.y;
            alive[i] = fma(u[i], u[i], v[i] * v[i]) > 0.0f ? 1.0f : 0.0f;
            if (!way) {
                own[i] = texture[TEXEL_AT((float)columns[i] + 0.5f, (float)row + 0.5f, row * width + columns[i])];
                sum[i] = 0.0f;
                weight[i] = 0.0f;
            }
            weight[i] += along[0];
        }
        for (int k = 1; k <= count; ++k) {
            if (edge) EACH {
                const float a = fma(by, u[i], x[i]), b = fma(by, v[i], y[i]);
                const float left = (float)-columns[i], top = (float)-row;
                const int stays = a >= left && a < left + fw && b >= top && b < top + fh;
                alive[i] = stays ? alive[i] : 0.0f;
                u[i] = stays ? u[i] : 0.0f;
                v[i] = stays ? v[i] : 0.0f;
            }
            const float w = along[k];
            EACH {
                x[i] = fma(by, u[i], x[i]);
                y[i] = fma(by, v[i], y[i]);
                int a = (int)x[i], b = (int)y[i];
                a += columns[i] - (x[i] < (float)a);
                b += row - (y[i] < (float)b);
                const int cell = b * width + a;
                const float2 s = vload2(cell, steps);
                const float next_u = s.x, next_v = s.y;
                const float share = w * alive[i];
                /* A line that has ended rests on a texel that it has read: weight zero times NaN is no news. */
                const float texel = texture[TEXEL_AT((float)columns[i] + x[i], (float)row + y[i], cell)];
                sum[i] = fma(share, texel - own[i], sum[i]);
                weight[i] += share;
                alive[i] = fma(next_u, u[i], next_v * v[i]) > 0.0f ? alive[i] : 0.0f;
                u[i] = next_u;
                v[i] = next_v;
            }
        }
    }
    EACH {
        if (first + i >= width) break;
        result[((size_t)row * width + first + i) * stride + channel] = weight[i] > 0.0f ? own[i] + sum[i] / weight[i] : own[i];
    }
}
#endif
