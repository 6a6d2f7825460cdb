// A test of every pixel, and what becomes of its counter; mask.py is the definition.
//
// `test`, `pass` and `fail` are places in its enumerations. Where `own`, the image is compared with the counter instead of
// the reference; where `by_image`, its value replaces counters.

#include "numeric.clh"
#include "planes.clh"

#define ONE ((float16)(1.0f))
#define ZERO ((float16)(0.0f))

PLANE_FN float16 stepped(int step, float16 s, float16 by, float16 most)
{
    switch (step) {
    case 0: return s;
    case 1: return ZERO;
    case 2: return by;
    case 3: return num_min(s + ONE, most);
    case 4: return num_max(s - ONE, ZERO);
    default: return most - s;
    }
}

kernel void mask(global const float *restrict image, global const float *restrict counter, global float *restrict out,
                 int channels, int channel, int counted, int test,
                 int pass, int fail, int own, int by_image, float reference, float replacement, float most, ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)LANES;
    if (first >= pixels)
        return;
    int count = (int)min(pixels - first, (ulong)LANES);
    float16 v = plane_load(image + first * channels, channels, channel, count);
    float16 s = counted ? plane_load(counter + first, 1, 0, count) : ZERO;
    float16 r = own ? s : (float16)(reference);
    float16 yes = stepped(pass, s, by_image ? v : (float16)(replacement), (float16)(most));
    float16 no = stepped(fail, s, by_image ? v : (float16)(replacement), (float16)(most));
    float16 y;
    switch (test) {
    case 0: y = no; break;
    case 1: y = yes; break;
    case 2: y = v < r ? yes : no; break;
    case 3: y = v <= r ? yes : no; break;
    case 4: y = v == r ? yes : no; break;
    case 5: y = v >= r ? yes : no; break;
    case 6: y = v > r ? yes : no; break;
    default: y = v != r ? yes : no; break;
    }
    planes_stream(&y, out + first, 1, count, pixels);
}
