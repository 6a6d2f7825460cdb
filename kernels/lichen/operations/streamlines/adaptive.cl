/* Line integral convolution in steps as long as their error allows; the twin of `lichen.operations.streamlines.adaptive`.
 *
 * The lines of a segment try their steps together; a line that has come far enough waits for the others. */

#include "texels.clh"

typedef struct {
    Vectors at, slope, vector, before, before_slope; /* at the end of the last step, and at its start */
    float s[SEGMENT], before_s[SEGMENT], step[SEGMENT], ended[SEGMENT];
} Knots;

#define STAGE(K, NODE, X)                                                                                              \
    EACH {                                                                                                             \
        X                                                                                                              \
        q.x[i] = fma(step[i], mx, n->at.x[i]);                                                                         \
        q.y[i] = fma(step[i], my, n->at.y[i]);                                                                         \
        when[i] = sign * fma(NODE, step[i], n->s[i]);                                                                  \
    }                                                                                                                  \
    look_each(&there, &p, flow, &q, columns, row, when);                                                               \
    displace(&K, &there, sign, flow->arc)

/* One step of the lines that are `wanting`, kept or not. */
inline void attempt(Knots *restrict n, const int *restrict wanting, const Flow *flow, const int *restrict columns, int row,
                    float sign, float length, float tolerance, float shortest) {
    Places p;
    Vectors q, there, k2, k3, k4, k5, k6, k7, d;
    const Vectors *k1 = &n->slope;
    float step[SEGMENT], when[SEGMENT], share[SEGMENT], error[SEGMENT];
    EACH {
        const float left = length - n->s[i];
        step[i] = n->step[i] < left ? n->step[i] : left;
    }
#define SUM(axis, e) const float m##axis = e
#define K(s, axis) k##s.axis[i]
#define BOTH(e1, e2) SUM(x, e1); SUM(y, e2);
    STAGE(k2, 0.2f, BOTH(0.2f * k1->x[i], 0.2f * k1->y[i]));
    STAGE(k3, 0.3f, BOTH((3.0f / 40) * k1->x[i] + (9.0f / 40) * K(2, x), (3.0f / 40) * k1->y[i] + (9.0f / 40) * K(2, y)));
#define E4(a) (44.0f / 45) * k1->a[i] - (56.0f / 15) * K(2, a) + (32.0f / 9) * K(3, a)
    STAGE(k4, 0.8f, BOTH(E4(x), E4(y)));
#define E5(a)                                                                                                          \
    (19372.0f / 6561) * k1->a[i] - (25360.0f / 2187) * K(2, a) + (64448.0f / 6561) * K(3, a) - (212.0f / 729) * K(4, a)
    STAGE(k5, (8.0f / 9), BOTH(E5(x), E5(y)));
#define E6(a)                                                                                                          \
    (9017.0f / 3168) * k1->a[i] - (355.0f / 33) * K(2, a) + (46732.0f / 5247) * K(3, a) + (49.0f / 176) * K(4, a) -    \
        (5103.0f / 18656) * K(5, a)
    STAGE(k6, 1.0f, BOTH(E6(x), E6(y)));
#define E7(a)                                                                                                          \
    (35.0f / 384) * k1->a[i] + (500.0f / 1113) * K(3, a) + (125.0f / 192) * K(4, a) - (2187.0f / 6784) * K(5, a) +     \
        (11.0f / 84) * K(6, a)
    STAGE(k7, 1.0f, BOTH(E7(x), E7(y)));
#define ERROR(a)                                                                                                       \
    (71.0f / 57600) * k1->a[i] - (71.0f / 16695) * K(3, a) + (71.0f / 1920) * K(4, a) -                                \
        (17253.0f / 339200) * K(5, a) + (22.0f / 525) * K(6, a) - (1.0f / 40) * K(7, a)
    int any = 0;
    EACH {
        const float x = fabs(step[i] * (ERROR(x))), y = fabs(step[i] * (ERROR(y)));
        error[i] = x > y ? x : (x == x ? y : x);
        const int astray = error[i] != error[i];
        d.x[i] = step[i] * (astray ? k1->x[i] : E7(x));
        d.y[i] = step[i] * (astray ? k1->y[i] : E7(y));
        any |= astray & (step[i] <= shortest) & wanting[i];
    }
    if (any) {
        Vectors v;
        offset(&q, &n->at, &d, 1.0f);
        look_each(&v, &p, flow, &q, columns, row, when);
        EACH {
            const int astray = error[i] != error[i];
            there.x[i] = astray ? v.x[i] : there.x[i];
            there.y[i] = astray ? v.y[i] : there.y[i];
        }
    }
    EACH share[i] = 1.0f;
    cut_at_border(share, &n->at, &d, columns, row, flow->width, flow->height);
    cut_at_critical_points(share, &n->vector, &there, &d, sign);
    displace(&k7, &there, sign, flow->arc);
    EACH {
        const int good = error[i] <= tolerance, least = step[i] <= shortest;
        const int kept = wanting[i] & (good | least);
        const float f = share[i] > 0.0f ? share[i] : 0.0f, h = step[i], from = n->s[i];
        const float grown = error[i] <= tolerance * 0.015625f ? 2.0f * h : h;
        const float next = good ? (grown > shortest ? grown : shortest) : (least ? h : 0.5f * h);
        n->step[i] = wanting[i] ? next : n->step[i];
        const int whole = (f == 1.0f) & (error[i] == error[i]), moves = f > 0.0f;
        const float sx = whole ? k1->x[i] : (moves ? d.x[i] / h : 0.0f), sy = whole ? k1->y[i] : (moves ? d.y[i] / h : 0.0f);
        n->before_slope.x[i] = kept ? sx : n->before_slope.x[i];
        n->before_slope.y[i] = kept ? sy : n->before_slope.y[i];
        n->before_s[i] = kept ? from : n->before_s[i];
        n->before.x[i] = kept ? n->at.x[i] : n->before.x[i];
        n->before.y[i] = kept ? n->at.y[i] : n->before.y[i];
        n->at.x[i] = kept & moves ? fma(f, d.x[i], n->at.x[i]) : n->at.x[i];
        n->at.y[i] = kept & moves ? fma(f, d.y[i], n->at.y[i]) : n->at.y[i];
        n->vector.x[i] = kept ? there.x[i] : n->vector.x[i];
        n->vector.y[i] = kept ? there.y[i] : n->vector.y[i];
        n->s[i] = kept ? (h == length - from ? length : from + h) : from;
        n->ended[i] = kept & (f < 1.0f) ? fma(f, h, from) : n->ended[i];
    }
    EACH {
        const int kept = wanting[i] & ((error[i] <= tolerance) | (step[i] <= shortest));
        n->slope.x[i] = kept ? k7.x[i] : n->slope.x[i];
        n->slope.y[i] = kept ? k7.y[i] : n->slope.y[i];
    }
}

/* Places of the lines at `target`, or where they ended: on the cubic through the ends of the step, on its chord where the
 * step was cut. */
inline void between(Vectors *restrict out, const Knots *restrict n, float target) {
    EACH {
        const float step = (n->ended[i] < n->s[i] ? n->ended[i] : n->s[i]) - n->before_s[i];
        const float part = (target - n->before_s[i]) / step, u = step > 0.0f ? (part < 1.0f ? part : 1.0f) : 1.0f;
        const float left = 1.0f - u, mix = (3.0f - 2.0f * u) * u * u, bend = u * left;
        const float ax = n->before.x[i], ay = n->before.y[i], dx = n->at.x[i] - ax, dy = n->at.y[i] - ay;
        const float mx = n->before_slope.x[i] * step, my = n->before_slope.y[i] * step;
        const float nx = n->slope.x[i] * step, ny = n->slope.y[i] * step;
        const float cx = ax + mix * dx + bend * (left * mx - u * nx), cy = ay + mix * dy + bend * (left * my - u * ny);
        const int open = n->ended[i] == INFINITY;
        out->x[i] = open & (cx == cx) ? cx : fma(u, dx, ax);
        out->y[i] = open & (cy == cy) ? cy : fma(u, dy, ay);
    }
}

kernel void adapt(global const float *restrict now, global const float *restrict later, global const float *restrict texture,
                  global const float *restrict weights, global float *restrict result, int width, int height,
                  int texture_width, int texture_height, int stride, int channel, int count, float spacing, float length,
                  float tolerance, float shortest, int arc, float time, float pace) {
    const int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height) return;
    const Flow flow = {now, later, width, height, arc, time, pace};
    int columns[SEGMENT];
    EACH columns[i] = min(first + i, width - 1);
    Home home;
    settle(&home, columns, row, width, height, texture_width, texture_height);

    Places p;
    Knots n;
    Vectors at, start;
    Texel own[SEGMENT], sum[SEGMENT], last[SEGMENT], sampled[SEGMENT];
    float weight[SEGMENT], share[SEGMENT];
    texture += channel;
    EACH {
        at.x[i] = at.y[i] = 0.0f;
        sum[i] = (Texel)0.0f;
        weight[i] = 0.0f;
    }
    find(&p, &at, &home);
    sample(own, texture, stride, &p, texture_width, texture_height);
    look(&start, &p, &flow, &at, columns, row, 0.0f);

    for (int way = 0; way < 2; ++way) {
        const float sign = way ? -1.0f : 1.0f;
        global const float *k = weights + way * (count + 1);
        n.vector = start;
        displace(&n.slope, &start, sign, arc);
        n.before_slope = n.slope;
        EACH {
            n.at.x[i] = n.at.y[i] = n.before.x[i] = n.before.y[i] = n.s[i] = n.before_s[i] = 0.0f;
            n.step[i] = spacing;
            n.ended[i] = INFINITY;
            last[i] = own[i] - own[i];
        }
        for (int j = 1; j <= count; ++j) {
            const float target = j == count ? length : (float)j * spacing;
            for (;;) {
                int wanting[SEGMENT], any = 0;
                EACH {
                    wanting[i] = (n.s[i] < target) & (n.ended[i] == INFINITY);
                    any |= wanting[i];
                }
                if (!any) break;
                attempt(&n, wanting, &flow, columns, row, sign, length, tolerance, shortest);
            }
            int on = 0;
            EACH {
                const float end = n.ended[i] < target ? n.ended[i] : target, f = 1.0f - (target - end) / spacing;
                share[i] = f > 0.0f ? f : 0.0f;
                on |= share[i] > 0.0f;
            }
            if (!on) break;
            between(&at, &n, target);
            find(&p, &at, &home);
            sample(sampled, texture, stride, &p, texture_width, texture_height);
            accumulate(sum, weight, last, own, sampled, share, k[j - 1], k[j]);
        }
    }
    EACH {
        if (first + i >= width) break;
        const Texel mean = weight[i] > 0.0f ? own[i] + sum[i] / weight[i] : own[i];
        STORE(mean, result + ((size_t)row * width + first + i) * stride + channel);
    }
}
