/* The figures of two pictures' differences in one pass, in doubles; differences.py says what they are.
 *
 * One work-item takes `share` samples, of rows of `wide` samples, and walks through them in runs that lie inside or in
 * the border, which is `left` samples and `above` rows wide. Differences above `bound` are kept, in any order, as long as
 * there is room: they are ranked later. Built with COVERAGE, the channels where colour is straight, else 0, and CODES and
 * ULPS, whether those are wanted.
 *
 * Vectors whose differences are all finite take the quick way, which is bound by conversions to doubles. */

#include "mask.clh"

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define LANES 8
#define WAITING 64 /* differences that an item holds before it asks for a place among those of all */
#define FN static inline __attribute__((always_inline))

typedef struct {
    double sum, squares, largest, count;
} Totals;

typedef struct {
    double high[WAITING + LANES];
    int waiting;
    double mismatched, spoilt, equal, ulps, most[2], unlike[2];
} Found;

/* What a sample shows: colour times its coverage. */
FN double shown(global const float *restrict in, ulong at)
{
#if COVERAGE
    ulong alpha = at / COVERAGE * COVERAGE + COVERAGE - 1;
    return alpha == at ? (double)in[at] : (double)in[at] * in[alpha];
#else
    return in[at];
#endif
}

FN double8 shown_eight(global const float *restrict in, ulong at)
{
#if COVERAGE
    double each[LANES];
    for (int i = 0; i < LANES; i++)
        each[i] = shown(in, at + i);
    return vload8(0, each);
#else
    return convert_double8(vload8(0, in + at));
#endif
}

FN void hand_over(Found *found, global double *restrict high, global uint *restrict kept, uint room)
{
    uint place = atomic_add(kept, (uint)found->waiting);
    for (int i = 0; i < found->waiting; i++)
        if (place + i < room)
            high[place + i] = found->high[i];
    found->waiting = 0;
}

/* The code that each sample is stored as, of so many above 0. */
FN float8 codes(float8 x, float levels)
{
    float8 y = rint(x * levels);
    y = y < 0.0f ? (float8)(0.0f) : y;
    return y > levels ? (float8)(levels) : y;
}

/* What one in the last place of each is worth, as a factor to count by; below the smallest normal float it stays. */
FN double8 units_in(float8 x)
{
    long8 exponent = convert_long8(as_uint8(x) >> 23 & 255);
    exponent = exponent < 1 ? (long8)(1) : exponent;
    return as_double8((150 + 1023 - exponent) << 52);
}

FN double most_of(double8 v)
{
    double4 a = v.lo > v.hi ? v.lo : v.hi;
    double2 b = a.lo > a.hi ? a.lo : a.hi;
    return b.x > b.y ? b.x : b.y;
}

FN double sum_of(double8 v)
{
    double4 a = v.lo + v.hi;
    double2 b = a.lo + a.hi;
    return b.x + b.y;
}

/* One sample, whatever it is. */
FN void take_one(global const float *restrict image, global const float *restrict reference, ulong at, double bound,
                 Totals *totals, Found *found)
{
    double a = shown(image, at), b = shown(reference, at), apart = fabs(a - b);
    if (fabs(a) < INFINITY && fabs(b) < INFINITY) {
        totals->sum += apart;
        totals->squares += apart * apart;
        totals->largest = apart > totals->largest ? apart : totals->largest;
        totals->count += 1.0;
        found->equal += apart == bound ? 1.0 : 0.0;
        if (apart > bound)
            found->high[found->waiting++] = apart;
    } else
        found->mismatched += a == b || (a != a && b != b) ? 0.0 : 1.0;
    float x = image[at], y = reference[at];
    if (!(fabs(x) < INFINITY && fabs(y) < INFINITY)) {
        found->spoilt += x == y || (x != x && y != y) ? 0.0 : 1.0;
        return;
    }
#if CODES
    for (int i = 0; i < 2; i++) {
        float levels = i ? 65535.0f : 255.0f, steps = fabs(codes((float8)(x), levels).x - codes((float8)(y), levels).x);
        found->most[i] = steps > found->most[i] ? steps : found->most[i];
        found->unlike[i] += steps > 0.0f ? 1.0 : 0.0;
    }
#endif
#if ULPS
    double off = fabs((double)x - y) * units_in((float8)(y)).s0;
    found->ulps = off > found->ulps ? off : found->ulps;
#endif
}

/* Samples `at` to `end`, which are of one region. */
FN void take(global const float *restrict image, global const float *restrict reference, ulong at, ulong end,
             double bound, Totals *totals, Found *found, global double *restrict high, global uint *restrict kept, uint room)
{
    double8 sum = 0.0, squares = 0.0, largest = 0.0, ulps = 0.0;
    long8 equal = 0;
    float8 most8 = 0.0f, most16 = 0.0f;
    int8 unlike8 = 0, unlike16 = 0;
    for (; at + LANES <= end; at += LANES) {
        double8 apart = fabs(shown_eight(image, at) - shown_eight(reference, at));
        if (mask_all(apart < INFINITY)) { /* then so are both sides */
            sum += apart;
            squares = fma(apart, apart, squares);
            largest = apart > largest ? apart : largest;
            totals->count += LANES;
            equal += apart == bound;
            if (mask_any(apart > bound)) {
                double each[LANES];
                vstore8(apart, 0, each);
                for (int i = 0; i < LANES; i++) {
                    found->high[found->waiting] = each[i];
                    found->waiting += each[i] > bound;
                }
            }
#if CODES || ULPS
            float8 x = vload8(0, image + at), y = vload8(0, reference + at);
#endif
#if CODES
            float8 steps8 = fabs(codes(x, 255.0f) - codes(y, 255.0f));
            float8 steps16 = fabs(codes(x, 65535.0f) - codes(y, 65535.0f));
            most8 = steps8 > most8 ? steps8 : most8;
            most16 = steps16 > most16 ? steps16 : most16;
            unlike8 += steps8 > 0.0f;
            unlike16 += steps16 > 0.0f;
#endif
#if ULPS
            double8 off = fabs(convert_double8(x) - convert_double8(y)) * units_in(y);
            ulps = off > ulps ? off : ulps;
#endif
        } else
            for (int i = 0; i < LANES; i++)
                take_one(image, reference, at + i, bound, totals, found);
        if (found->waiting >= WAITING)
            hand_over(found, high, kept, room);
    }
    for (; at < end; at++)
        take_one(image, reference, at, bound, totals, found);
    if (found->waiting >= WAITING)
        hand_over(found, high, kept, room);
    totals->sum += sum_of(sum);
    totals->squares += sum_of(squares);
    totals->largest = fmax(totals->largest, most_of(largest));
    found->equal -= sum_of(convert_double8(equal));
    found->ulps = fmax(found->ulps, most_of(ulps));
    found->most[0] = fmax(found->most[0], most_of(convert_double8(most8)));
    found->most[1] = fmax(found->most[1], most_of(convert_double8(most16)));
    found->unlike[0] -= sum_of(convert_double8(unlike8));
    found->unlike[1] -= sum_of(convert_double8(unlike16));
}

kernel void differences(global const float *restrict image, global const float *restrict reference,
                        global double *restrict out, global double *restrict high, global uint *restrict kept, uint room,
                        double bound, ulong share, ulong samples, ulong wide, ulong left, ulong above)
{
    ulong part = get_global_id(0), at = part * share, last = min(at + share, samples);
    if (at >= samples)
        return;
    ulong rows = samples / wide;
    Totals totals[2] = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
    Found found;
    found.waiting = 0;
    found.mismatched = found.spoilt = found.equal = found.ulps = 0.0;
    found.most[0] = found.most[1] = found.unlike[0] = found.unlike[1] = 0.0;
    while (at < last) {
        ulong row = at / wide, column = at % wide, right = wide - left;
        int within = row >= above && row + above < rows, inside = within && column >= left && column < right;
        ulong until = within && column < right ? (column < left ? left : right) : wide;
        ulong end = min(row * wide + until, last);
        take(image, reference, at, end, bound, &totals[inside], &found, high, kept, room);
        at = end;
    }
    hand_over(&found, high, kept, room);
    out += part * 16;
    for (int i = 0; i < 2; i++) {
        out[4 * i] = totals[i].sum;
        out[4 * i + 1] = totals[i].squares;
        out[4 * i + 2] = totals[i].largest;
        out[4 * i + 3] = totals[i].count;
        out[8 + i] = found.most[i];
        out[10 + i] = found.unlike[i];
    }
    out[12] = found.mismatched;
    out[13] = found.spoilt;
    out[14] = found.equal;
    out[15] = found.ulps;
}
