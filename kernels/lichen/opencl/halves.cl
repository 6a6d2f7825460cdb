// Halves as files store them, by their bits, to floats and back: as samples.cl does it with integers, for what
// `lichen.files.samples` does with NumPy. Loops are left to the compiler, which makes vectors of them.

#define BEYOND 0x477ff000u // 65520, the least that rounds to no finite half
#define INFINITE 0x7f800000u

kernel void widen(global const ushort *restrict codes, global float *restrict out, ulong count, int block)
{
    ulong start = (ulong)get_global_id(0) * block;
    int here = start < count ? (int)min((ulong)block, count - start) : 0;
    for (int i = 0; i < here; i++) {
        // The product moves the exponent, and makes ordinary numbers of denormal ones.
        uint code = codes[start + i], size = (code & 0x7fffu) << 13, made = as_uint(as_float(size) * 0x1p+112f);
        made |= size >= 0x0f800000u ? INFINITE : 0u;
        out[start + i] = as_float(made | (code & 0x8000u) << 16);
    }
}

// Rounds half to even. A finite number too large becomes the largest half, and is counted; what is none stays so.
kernel void quantise(global const float *restrict values, global ushort *restrict out, global int *restrict moved,
                     ulong count, int block)
{
    size_t item = get_global_id(0);
    ulong start = (ulong)item * block;
    if (start >= count)
        return;
    int here = (int)min((ulong)block, count - start), clipped = 0;
    global const float *from = values + start;
    global ushort *to = out + start;
    uint largest = 0;
    for (int i = 0; i < here; i++) {
        uint bits = as_uint(from[i]), size = bits & 0x7fffffffu;
        uint ordinary = (size - 0x38000000u + 0xfffu + (size >> 13 & 1u)) >> 13;
        uint denormal = as_uint(as_float(size) + 0.5f) - 0x3f000000u; // beside a half there is room for as many bits
        largest = max(largest, size);
        to[i] = (ushort)((size < 0x38800000u ? denormal : ordinary) | (bits >> 16 & 0x8000u));
    }
    for (int i = 0; i < here && largest >= BEYOND; i++) {
        uint bits = as_uint(from[i]), size = bits & 0x7fffffffu, sign = bits >> 16 & 0x8000u;
        if (size < BEYOND)
            continue;
        clipped += size < INFINITE;
        to[i] = (ushort)(sign | (size < INFINITE ? 0x7bffu : (size == INFINITE ? 0x7c00u : 0x7e00u)));
    }
    moved[2 * item] = clipped;
    moved[2 * item + 1] = 0;
}
