/* Line integral convolution.
 *
 * One work-item follows the lines of SEGMENT neighbouring pixels of a row at once. Each phase of a step is a loop over the
 * segment, so that arithmetic is done in full vectors; only `fetch` goes pixel by pixel, with loads as wide as the two
 * neighbours it interpolates. A line that has ended stays where it is and weighs nothing.
 *
 * Positions are kept relative to the pixel a line started from: rounding does not grow with the size of the image.
 * NaN is the mark of "no direction here": zero and non-finite vectors turn into it, and no comparison with it holds.
 *
 * Built with ORDER (1, 2, 4: Euler, midpoint, Runge-Kutta), CHANNELS (1 to 4: channels of the texture done at once) and
 * SAME (whether texture and field are of one size).
 */

#include "field.clh"
#include "hash.clh"

#if CHANNELS == 1
typedef float Texel;
#define LOAD(p) (*(p))
#define STORE(t, p) (*(p) = (t))
#elif CHANNELS == 2
typedef float2 Texel;
#define LOAD(p) vload2(0, p)
#define STORE(t, p) vstore2(t, 0, p)
#elif CHANNELS == 3
typedef float3 Texel;
#define LOAD(p) vload3(0, p)
#define STORE(t, p) vstore3(t, 0, p)
#else
typedef float4 Texel;
#define LOAD(p) vload4(0, p)
#define STORE(t, p) vstore4(t, 0, p)
#endif

/* ------------------------------------------------------------------------------------------------- preparation */

kernel void decode(global const float *restrict image, global float *restrict field, int count, int stride, float scale,
                   float bias, float limit) {
    const int first = get_global_id(0) * SEGMENT;
    float x[SEGMENT], y[SEGMENT];
    vectors_at(x, y, image, first, count, stride, scale, bias, limit);
    for (int i = 0; i < SEGMENT && first + i < count; ++i) vstore2((float2)(x[i], y[i]), first + i, field);
}

/* White noise of `lichen.operations.streamlines.lic.noise`, bit for bit. */
kernel void noise(global float *restrict texture, int width, int height, uint seed) {
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height) return;
    uint a = x, b = y, c = seed;
    hash_pcg3d(&a, &b, &c);
    texture[(size_t)y * width + x] = hash_unit(a);
}

/* ---------------------------------------------------------------------------------------------- Runge-Kutta lines */

typedef struct {
    int cell[SEGMENT], below[SEGMENT]; /* the upper left of the four neighbours, and the one below it */
    float x[SEGMENT], y[SEGMENT];      /* fractions between them */
} Places;

typedef struct {
    float x[SEGMENT], y[SEGMENT];
} Vectors;

/* Cells and fractions of the points `at`, given from cell (columns, row); clamped to the image.
 * A neighbour of weight zero is replaced by its partner: what is beside the point does not touch it, be it NaN. */
inline void locate(Places *restrict p, const Vectors *restrict at, const int *restrict columns, int row, int width,
                   int height) {
    EACH {
        const float x = within(at->x[i], (float)-columns[i], (float)(width - 1 - columns[i]));
        const float y = within(at->y[i], (float)-row, (float)(height - 1 - row));
        int a = (int)x, b = (int)y;
        a -= x < (float)a;
        b -= y < (float)b;
        p->x[i] = x - (float)a;
        p->y[i] = y - (float)b;
        p->cell[i] = (row + b) * width + columns[i] + a;
        p->below[i] = p->cell[i] + (p->y[i] > 0.0f ? width : 0);
    }
}

/* The vectors at `p`, interpolated component by component. `field` has one pair more than pixels. */
inline void fetch(Vectors *restrict v, global const float *restrict field, const Places *restrict p) {
    float4 rows[SEGMENT];
    EACH {
        const float4 a = vload4(0, field + 2 * (size_t)p->cell[i]), b = vload4(0, field + 2 * (size_t)p->below[i]);
        rows[i] = fma((float4)p->y[i], b - a, a);
    }
    const float *r = (const float *)rows;
    EACH {
        const float t = p->x[i], ax = r[4 * i], ay = r[4 * i + 1], bx = r[4 * i + 2], by = r[4 * i + 3];
        v->x[i] = t > 0.0f ? fma(t, bx - ax, ax) : ax;
        v->y[i] = t > 0.0f ? fma(t, by - ay, ay) : ay;
    }
}

/* Displacements along the vectors `v`: of length |step|, or step x v. NaN for a zero vector. The larger component is
 * first brought near 1, so that no square under- or overflows. */
inline void displace(Vectors *restrict d, const Vectors *restrict v, float step, int arc) {
    EACH {
        const float u = fabs(v->x[i]), w = fabs(v->y[i]), m = u > w ? u : w;
        const float s = power_near(m), x = v->x[i] * s, y = v->y[i] * s, q = fma(x, x, y * y);
        const float along = step / sqrt(q), by = q > 0.0f ? step : NAN;
        d->x[i] = arc ? x * along : v->x[i] * by;
        d->y[i] = arc ? y * along : v->y[i] * by;
    }
}

inline void offset(Vectors *restrict to, const Vectors *restrict from, const Vectors *restrict d, float share) {
    EACH {
        to->x[i] = fma(share, d->x[i], from->x[i]);
        to->y[i] = fma(share, d->y[i], from->y[i]);
    }
}

/* Keeps the least product of Euler's displacement with a later stage's. */
inline void agree(float *restrict agreement, const Vectors *restrict euler, const Vectors *restrict stage) {
    EACH {
        const float product = fma(euler->x[i], stage->x[i], euler->y[i] * stage->y[i]);
        agreement[i] = product < agreement[i] ? product : agreement[i];
    }
}

/* The displacement of one step of the method, but Euler's where a later stage opposes it: a critical point lies ahead,
 * and stages on both of its sides would cancel and leave the line standing short of it. From the points `at`,
 * where the vectors are `here`. */
inline void advance(Vectors *restrict d, const Vectors *restrict at, const Vectors *restrict here,
                    global const float *restrict field, const int *restrict columns, int row, int width, int height,
                    float step, int arc) {
    displace(d, here, step, arc);
#if ORDER > 1
    Places p;
    Vectors q, v, k, sum;
    float agreement[SEGMENT];
    EACH agreement[i] = 0.0f;
    offset(&q, at, d, 0.5f);
    locate(&p, &q, columns, row, width, height);
    fetch(&v, field, &p);
    displace(&k, &v, step, arc);
    agree(agreement, d, &k);
#if ORDER == 2
    sum = k;
#else
    offset(&sum, d, &k, 2.0f);
    offset(&q, at, &k, 0.5f);
    locate(&p, &q, columns, row, width, height);
    fetch(&v, field, &p);
    displace(&k, &v, step, arc);
    agree(agreement, d, &k);
    offset(&sum, &sum, &k, 2.0f);
    offset(&q, at, &k, 1.0f);
    locate(&p, &q, columns, row, width, height);
    fetch(&v, field, &p);
    displace(&k, &v, step, arc);
    agree(agreement, d, &k);
    EACH {
        sum.x[i] = (sum.x[i] + k.x[i]) * (1.0f / 6.0f);
        sum.y[i] = (sum.y[i] + k.y[i]) * (1.0f / 6.0f);
    }
#endif
    EACH {
        const int opposed = agreement[i] < 0.0f || d->x[i] != d->x[i];
        d->x[i] = opposed ? d->x[i] : sum.x[i];
        d->y[i] = opposed ? d->y[i] : sum.y[i];
    }
#endif
}

/* Shortens the shares of the steps that cross the border. */
inline void cut_at_border(float *restrict share, const Vectors *restrict at, const Vectors *restrict d,
                          const int *restrict columns, int row, int width, int height) {
    EACH {
        const float x = at->x[i] + d->x[i], y = at->y[i] + d->y[i];
        const float left = -0.5f - (float)columns[i], top = -0.5f - (float)row;
        const float cx = within(x, left, left + (float)width), cy = within(y, top, top + (float)height);
        const float fx = x != cx ? (cx - at->x[i]) / d->x[i] : 1.0f, fy = y != cy ? (cy - at->y[i]) / d->y[i] : 1.0f;
        const float f = fx < fy ? fx : fy;
        share[i] = f < share[i] ? f : share[i];
    }
}

/* Shortens the shares of the steps that the field at their end opposes: between the two lies a critical point, where
 * the component along the step, taken as linear, is zero. A step without direction is not made at all. */
inline void cut_at_critical_points(float *restrict share, const Vectors *restrict here, const Vectors *restrict there,
                                   const Vectors *restrict d, float sign) {
    EACH {
        const float x = d->x[i] * 0.0625f, y = d->y[i] * 0.0625f; /* the products stay finite */
        const float before = fabs(fma(here->x[i], x, here->y[i] * y)), after = sign * fma(there->x[i], x, there->y[i] * y);
        const float f = after < 0.0f ? before / (before - after) : 1.0f;
        share[i] = x != x || y != y ? 0.0f : (f < share[i] ? f : share[i]);
    }
}

/* The texture at `p`, interpolated. It has one value more than pixels. */
inline void sample(Texel *restrict out, global const float *restrict texture, int stride, const Places *restrict p) {
#if CHANNELS == 1
    if (stride == 1) {
        float2 rows[SEGMENT];
        EACH {
            const float2 a = vload2(0, texture + p->cell[i]), b = vload2(0, texture + p->below[i]);
            rows[i] = fma((float2)p->y[i], b - a, a);
        }
        const float *r = (const float *)rows;
        EACH {
            const float a = r[2 * i], b = r[2 * i + 1];
            out[i] = p->x[i] > 0.0f ? fma(p->x[i], b - a, a) : a;
        }
        return;
    }
#endif
    EACH {
        const int right = p->x[i] > 0.0f ? stride : 0;
        global const float *u = texture + (size_t)p->cell[i] * stride, *v = texture + (size_t)p->below[i] * stride;
        const Texel s = LOAD(u), t = LOAD(v);
        const Texel above = fma((Texel)p->x[i], LOAD(u + right) - s, s), under = fma((Texel)p->x[i], LOAD(v + right) - t, t);
        out[i] = fma((Texel)p->y[i], under - above, above);
    }
}

/* Adds the steps' trapezoids, weights `a` to `b` of the kernel, and takes the samples at their ends as the next starts. */
inline void accumulate(Texel *restrict sum, float *restrict weight, Texel *restrict last, const Texel *restrict own,
                       global const float *restrict texture, int stride, const Places *restrict p,
                       const float *restrict share, float a, float b) {
    Texel sampled[SEGMENT];
    sample(sampled, texture, stride, p);
    EACH {
        const Texel sample = sampled[i] - own[i];
        const float half_share = 0.5f * share[i], end = fma(share[i], b - a, a);
        const Texel piece = half_share * (a * last[i] + end * sample);
        sum[i] += half_share > 0.0f ? piece : (Texel)0.0f;
        weight[i] += half_share * (a + end);
        last[i] = sample;
    }
}

/* `kernels` holds the weights k(0), k(h), ..., k(count h). `reach` is how far a line can go. */
kernel void follow(global const float *restrict field, global const float *restrict texture,
                   global const float *restrict weights, global float *restrict result, int width, int height,
                   int texture_width, int texture_height, int stride, int channel, int count, float step, int arc,
                   float reach) {
    const int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height) return;
    const int edge = !(first > reach && first + SEGMENT + reach < width && row > reach && row + 1 + reach < height);
    const float scale_x = (float)texture_width / (float)width, scale_y = (float)texture_height / (float)height;

    /* The pixel centre in the texture: cell and fraction, split exactly. */
    const long y_part = (2L * row + 1) * texture_height - height, y_whole = 2L * height;
    const int texture_row = (int)((y_part + y_whole) / y_whole) - 1;
    const float texture_y = (float)(y_part - texture_row * y_whole) / (float)y_whole;
    int columns[SEGMENT], texture_columns[SEGMENT];
    float texture_x[SEGMENT];
    EACH {
        columns[i] = min(first + i, width - 1);
        const long part = (2L * columns[i] + 1) * texture_width - width, whole = 2L * width;
        texture_columns[i] = (int)((part + whole) / whole) - 1;
        texture_x[i] = (float)(part - texture_columns[i] * whole) / (float)whole;
    }

    Places p;
    Vectors at, here, there, d;
    Texel own[SEGMENT], sum[SEGMENT], last[SEGMENT];
    float weight[SEGMENT], share[SEGMENT], alive[SEGMENT], nothing[SEGMENT];
    texture += channel;
    EACH {
        at.x[i] = texture_x[i];
        at.y[i] = texture_y;
        own[i] = last[i] = sum[i] = (Texel)0.0f;
        weight[i] = nothing[i] = 0.0f;
    }
    locate(&p, &at, texture_columns, texture_row, texture_width, texture_height);
    accumulate(sum, weight, last, own, texture, stride, &p, nothing, 0.0f, 0.0f);
    EACH own[i] = last[i];

    for (int way = 0; way < 2; ++way) {
        const float sign = way ? -1.0f : 1.0f;
        EACH {
            at.x[i] = at.y[i] = 0.0f;
            alive[i] = 1.0f;
            last[i] = own[i] - own[i];
            here.x[i] = field[2 * ((size_t)row * width + columns[i])];
            here.y[i] = field[2 * ((size_t)row * width + columns[i]) + 1];
        }
        for (int k = 0; k < count; ++k) {
            Vectors q;
            advance(&d, &at, &here, field, columns, row, width, height, sign * step, arc);
            offset(&q, &at, &d, 1.0f);
            locate(&p, &q, columns, row, width, height);
            fetch(&there, field, &p);
            EACH share[i] = alive[i];
            if (edge) cut_at_border(share, &at, &d, columns, row, width, height);
            cut_at_critical_points(share, &here, &there, &d, sign);
            int cut = !SAME;
            EACH {
                at.x[i] = share[i] > 0.0f ? fma(share[i], d.x[i], at.x[i]) : at.x[i];
                at.y[i] = share[i] > 0.0f ? fma(share[i], d.y[i], at.y[i]) : at.y[i];
                alive[i] = share[i] == 1.0f ? 1.0f : 0.0f;
                cut |= share[i] > 0.0f && share[i] < 1.0f;
                here.x[i] = there.x[i];
                here.y[i] = there.y[i];
            }
            /* Where texture and field are of one size and no step was cut, the texels lie where the vectors did. */
            if (cut) {
                EACH {
                    q.x[i] = fma(at.x[i], scale_x, texture_x[i]);
                    q.y[i] = fma(at.y[i], scale_y, texture_y);
                }
                locate(&p, &q, texture_columns, texture_row, texture_width, texture_height);
            }
            accumulate(sum, weight, last, own, texture, stride, &p, share, weights[k], weights[k + 1]);
        }
    }
    EACH {
        if (first + i >= width) break;
        const Texel mean = weight[i] > 0.0f ? own[i] + sum[i] / weight[i] : own[i];
        STORE(mean, result + ((size_t)row * width + first + i) * stride + channel);
    }
}
