// Samples as files store them, to floats and back, a work-item for each `block` of them: what `lichen.files.samples`
// does with NumPy, bit for bit. CODE is the type of a stored sample and LEVELS its largest value, a float.
//
// Beside SHIFT no fraction has room, so that adding it rounds half to even and leaves the code in the lowest bits. What
// lies outside the codes, or is no number, gives bits that are larger; a block with such a value is gone through again,
// one by one. Loops are left to the compiler, which makes vectors of them. Bound by bytes.
#include "stream.clh"

#define SHIFT 12582912.0f // 3 * 2^22

kernel void widen(global const CODE *restrict codes, global float *restrict out, ulong count, int block)
{
    ulong start = (ulong)get_global_id(0) * block;
    int here = start < count ? (int)min((ulong)block, count - start) : 0;
    for (int i = 0; i < here; i++)
        out[start + i] = (float)codes[start + i] / LEVELS;
}

// What a table of 256 numbers says of each code.
kernel void look_up(global const uchar *restrict codes, global const float *restrict table, global float *restrict out,
                    ulong count, int block)
{
    ulong start = (ulong)get_global_id(0) * block;
    int here = start < count ? (int)min((ulong)block, count - start) : 0, i = 0;
    for (; i + 16 <= here; i += 16) {
        float line[16];
        for (int k = 0; k < 16; k++)
            line[k] = table[codes[start + i + k]];
        stream_store16(vload16(0, line), out + start + i, count);
    }
    for (; i < here; i++)
        out[start + i] = table[codes[start + i]];
}

kernel void quantise(global const float *restrict values, global CODE *restrict out, global int *restrict moved,
                     ulong count, int block)
{
    size_t item = get_global_id(0);
    ulong start = (ulong)item * block;
    if (start >= count)
        return;
    int here = (int)min((ulong)block, count - start);
    global const float *from = values + start;
    global CODE *to = out + start;
    uint largest = 0;
    for (int i = 0; i < here; i++) {
        uint code = as_uint(from[i] * LEVELS + SHIFT) - as_uint(SHIFT);
        largest = max(largest, code);
        to[i] = (CODE)code;
    }
    int clipped = 0, nonfinite = 0;
    for (int i = 0; i < here && largest > (uint)LEVELS; i++) {
        float v = from[i];
        uint code = as_uint(v * LEVELS + SHIFT) - as_uint(SHIFT);
        if (code > (uint)LEVELS) {
            to[i] = v > 0.0f ? (CODE)LEVELS : (CODE)0; // NaN to 0
            int finite = fabs(v) < INFINITY;
            clipped += finite;
            nonfinite += 1 - finite;
        }
    }
    moved[2 * item] = clipped;
    moved[2 * item + 1] = nonfinite;
}
