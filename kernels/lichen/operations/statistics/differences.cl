/* The figures of two pictures' differences in one pass, in doubles, and the map of them; differences.py says what they
 * are.
 *
 * One work-item takes `share` samples, of rows of `wide` samples, and walks through them in runs that lie inside or in
 * the border, which is `left` samples and `above` rows wide. Differences above `bound` are kept, in any order, as long as
 * there is room: they are ranked later. Built with COVERAGE, the channels where colour is straight, else 0, CODES and
 * ULPS, whether those are wanted, and MAP: 0 for none, 1 for how large differences are, 2 for signed ones.
 *
 * Blocks whose differences are all finite take the quick way. What every sample counts for is found in vectors; what a
 * few do, those that may exceed the bound or be the most units or codes apart, only in blocks that may have one, by their
 * largest difference and the smallest sample: 0.92 of the time. Of 2048 x 2048 RGB on two processors sums take 4.5 ms, no
 * more than reading the pictures, and all together twice as long. To ask for memory earlier, later or not at all, blocks
 * of 32 or 128 samples, and loops that are unrolled are no quicker. */

#include "mask.clh"
#include "stream.clh"

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define LANES 8
#define BLOCK 64 /* samples */
#define LINE 16 /* samples of a cache line, at which blocks begin where they can */
#define SIGNED 2
#define AHEAD 512 /* samples that are asked for before they are read */
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

/* What of a sample can be stored. The code that it is stored as, of so many above 0, is what is nearest to so many
 * times that. */
FN float8 clipped(float8 x)
{
    x = x < 0.0f ? (float8)(0.0f) : x;
    return x > 1.0f ? (float8)(1.0f) : x;
}

FN float8 steps(float8 x, float8 y, float levels)
{
    return fabs(rint(clipped(x) * levels) - rint(clipped(y) * levels));
}

/* Samples that are less apart are no more codes apart than `most`, or than one: a code is within a half of its product,
 * and a product, and a difference, is rounded by no more than 2^-24 of the largest. */
FN float least_of(float most, float levels) { return fmax(most, 1.0f) / levels * (1.0f - 0x1p-20f) - 0x1p-22f; }

/* How many units in the last place of y lie between x and it; those of the smallest normal float and below are alike. */
FN double units_apart(float x, float y)
{
    long exponent = max((long)(as_uint(y) >> 23 & 255), 1L);
    return fabs((double)x - y) * as_double((150 + 1023 - exponent) << 52);
}

/* What a power of two is multiplied by for a little less than so many of its units. */
FN float share_of(double units) { return (float)fmin(units * 0x1.ffffp-24, (double)FLT_MAX); }

/* Lanes in which more units in the last place of y lie between x and it than such a share stands for. */
FN int8 further_than(float8 apart, float8 y, float share)
{
    return apart > share * as_float8(max(as_int8(y) & 0x7f800000, 0x00800000));
}

FN int8 further(float8 x, float8 y, float share) { return further_than(fabs(x - y), y, share); }

/* A float that no difference taken in floats falls below where the exact one is `least` or more, which is not 0. */
FN float under(double least) { return least < 0.0 ? -1.0f : fmax((float)least * 0x1.fffffcp-1f, 0x1p-149f); }

FN float largest_of(float8 v)
{
    float4 a = v.lo > v.hi ? v.lo : v.hi;
    float2 b = a.lo > a.hi ? a.lo : a.hi;
    return b.x > b.y ? b.x : b.y;
}

FN double most_of(double8 v)
{
    double4 a = v.lo > v.hi ? v.lo : v.hi;
    double2 b = a.lo > a.hi ? a.lo : a.hi;
    return b.x > b.y ? b.x : b.y;
}

/* A comparison's lanes as bits, and the place of the lowest of some. */
FN uint bits_of(int8 lanes)
{
    int8 each = lanes & (int8)(1, 2, 4, 8, 16, 32, 64, 128);
    int4 four = each.lo | each.hi;
    int2 two = four.lo | four.hi;
    return two.x | two.y;
}

FN uint lowest(uint bits) { return (as_uint((float)(bits & -bits)) >> 23) - 127; }

FN double sum_of(double8 v)
{
    double4 a = v.lo + v.hi;
    double2 b = a.lo + a.hi;
    return b.x + b.y;
}

/* A difference that may be among the largest, with room for it. */
FN void rank_one(double apart, double bound, Found *found)
{
    found->equal += apart == bound ? 1.0 : 0.0;
    if (apart > bound)
        found->high[found->waiting++] = apart;
}

/* Eight differences as the map tells them; floats are as exact without coverage. */
FN float8 told(double8 apart, float8 x, float8 y)
{
    float8 d = COVERAGE ? convert_float8(apart) : x - y;
    return MAP == SIGNED ? d : fabs(d);
}

/* One sample, whatever it is. */
FN void take_one(global const float *restrict image, global const float *restrict reference, global float *restrict map,
                 ulong at, double bound, Totals *totals, Found *found)
{
    double a = shown(image, at), b = shown(reference, at), apart = fabs(a - b);
#if MAP
    map[at] = MAP == SIGNED ? (float)(a - b) : (float)apart;
#endif
    if (fabs(a) < INFINITY && fabs(b) < INFINITY) {
        totals->sum += apart;
        totals->squares += apart * apart;
        totals->largest = apart > totals->largest ? apart : totals->largest;
        totals->count += 1.0;
        rank_one(apart, bound, found);
    } else
        found->mismatched += a == b || (a != a && b != b) ? 0.0 : 1.0;
    float x = image[at], y = reference[at];
    if (!(fabs(x) < INFINITY && fabs(y) < INFINITY)) {
        found->spoilt += x == y || (x != x && y != y) ? 0.0 : 1.0;
        return;
    }
#if CODES
    for (int i = 0; i < 2; i++) {
        float apart = steps((float8)(x), (float8)(y), i ? 65535.0f : 255.0f).x;
        found->most[i] = apart > found->most[i] ? apart : found->most[i];
        found->unlike[i] += apart > 0.0f ? 1.0 : 0.0;
    }
#endif
#if ULPS
    found->ulps = fmax(found->ulps, units_apart(x, y));
#endif
}

/* Samples `at` to `end`, which are of one region. */
FN void take(global const float *restrict image, global const float *restrict reference, global float *restrict map,
             ulong samples, ulong at, ulong end, double bound, Totals *totals, Found *found,
             global double *restrict high, global uint *restrict kept, uint room)
{
    double8 sums = 0.0, squares = 0.0, largest = 0.0;
    float8 most8 = found->most[0], most16 = found->most[1];
    int8 unlike8 = 0, unlike16 = 0;
    float steep = fmin(least_of(found->most[0], 255.0f), least_of(found->most[1], 65535.0f));
    double least = bound == 0.0 ? DBL_MIN : bound;
    float near = under(least), share = share_of(found->ulps);
    for (int here; at < end; at += here) {
        int line = at % LINE, most_here = (int)min(end - at, (ulong)(line ? LINE - line : BLOCK));
        here = most_here / LANES * LANES;
        double8 sum = 0.0, square = 0.0, most = 0.0;
        int8 other8 = 0, other16 = 0;
        float8 widest = 0.0f, smallest = INFINITY; /* of differences, and of what the other is */
        float told_here[BLOCK] __attribute__((aligned(64)));
        for (int i = 0; i < here; i += LANES) {
            float8 x = vload8(0, image + at + i), y = vload8(0, reference + at + i);
            double8 apart = shown_eight(image, at + i) - shown_eight(reference, at + i);
#if MAP
            vstore8(told(apart, x, y), 0, told_here + i);
#endif
            apart = fabs(apart);
            sum += apart;
            square = fma(apart, apart, square);
            most = apart > most ? apart : most;
#if CODES || ULPS
            float8 raw = fabs(x - y);
            widest = raw > widest ? raw : widest;
#endif
#if CODES
            stream_ask(image + at + i + AHEAD);
            stream_ask(reference + at + i + AHEAD);
            float8 a = clipped(x), b = clipped(y);
            other8 += rint(a * 255.0f) != rint(b * 255.0f);
            other16 += rint(a * 65535.0f) != rint(b * 65535.0f);
#endif
#if ULPS
            float8 size = fabs(y);
            smallest = size < smallest ? size : smallest;
#endif
        }
#if MAP
        if (here == BLOCK)
            stream_store((const float16 *)told_here, BLOCK / 16, map + at, samples);
        else
            for (int i = 0; i < here; i += LANES)
                vstore8(vload8(0, told_here + i), 0, map + at + i);
#endif
        if (here == 0 || !mask_all(sum < INFINITY)) { /* where it is, both sides are */
            here = here ? here : most_here;
            for (int i = 0; i < here; i++) {
                take_one(image, reference, map, at + i, bound, totals, found);
                if (found->waiting >= WAITING)
                    hand_over(found, high, kept, room);
            }
            continue;
        }
        sums += sum;
        squares += square;
        largest = most > largest ? most : largest;
        totals->count += here;
#if CODES
        unlike8 += other8;
        unlike16 += other16;
        if (mask_any(widest >= steep)) {
            for (int i = 0; i < here; i += LANES) {
                float8 x = vload8(0, image + at + i), y = vload8(0, reference + at + i);
                float8 apart8 = steps(x, y, 255.0f), apart16 = steps(x, y, 65535.0f);
                most8 = apart8 > most8 ? apart8 : most8;
                most16 = apart16 > most16 ? apart16 : most16;
            }
            steep = fmin(least_of(largest_of(most8), 255.0f), least_of(largest_of(most16), 65535.0f));
        }
#endif
#if ULPS
        int8 far = further_than(widest, smallest, share);
#else
        int8 far = 0;
#endif
        if (!mask_any(far) && !mask_any(most >= least))
            continue;
        for (int i = 0; i < here; i += LANES) {
            float8 x = vload8(0, image + at + i), y = vload8(0, reference + at + i);
            int8 lanes = COVERAGE ? (int8)(-1) : fabs(x - y) >= near;
#if ULPS
            lanes |= further(x, y, share);
#endif
            if (!mask_any(lanes))
                continue;
            for (uint bits = bits_of(lanes); bits; bits &= bits - 1) {
                ulong each = at + i + lowest(bits);
                rank_one(fabs(shown(image, each) - shown(reference, each)), bound, found);
#if ULPS
                found->ulps = fmax(found->ulps, units_apart(image[each], reference[each]));
#endif
            }
            if (found->waiting >= WAITING)
                hand_over(found, high, kept, room);
        }
        share = share_of(found->ulps);
    }
    totals->sum += sum_of(sums);
    totals->squares += sum_of(squares);
    totals->largest = fmax(totals->largest, most_of(largest));
    double unlike[2] = {-sum_of(convert_double8(unlike8)), -sum_of(convert_double8(unlike16))};
    float reached[2] = {largest_of(most8), largest_of(most16)};
    for (int i = 0; i < 2; i++) {
        found->unlike[i] += unlike[i];
        /* what differs is one apart at least, which nobody looked for */
        found->most[i] = fmax(found->most[i], fmax((double)reached[i], unlike[i] > 0.0 ? 1.0 : 0.0));
    }
}

kernel void differences(global const float *restrict image, global const float *restrict reference,
                        global float *restrict map, global double *restrict out, global double *restrict high,
                        global uint *restrict kept, uint room, double bound, ulong share, ulong samples, ulong wide, ulong left, ulong above)
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
        take(image, reference, map, samples, at, end, bound, &totals[inside], &found, high, kept, room);
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
