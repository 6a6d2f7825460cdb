// An expression over images; expression.py writes its text.
//
// Definitions given at build time:
//   FLAT      1: every sample by itself, whatever pixel it belongs to; `pixels` then counts samples
//   LOAD      statements that read the images' planes
//   OUT       channels of the result
//   RESULTS   statements that set y[0] ... y[OUT - 1]
// `k` holds the expression's numbers, so that expressions that differ in numbers alone share a program.

#include "numeric.clh"
#include "../compositing/planes.clh"

#define ONE ((float16)(1.0f))
#define ZERO ((float16)(0.0f))
#define NUMBER(i) ((float16)(k[i]))

kernel void evaluate(global const float *restrict a, global const float *restrict b, global const float *restrict c,
                     global const float *restrict d, global float *restrict out, global const float *restrict k,
                     ulong columns, ulong rows, ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)LANES;
    if (first >= pixels)
        return;
    int count = (int)min(pixels - first, (ulong)LANES);
    float16 y[OUT];
#if FLAT == 0
    float at[LANES], down[LANES];
    for (int i = 0; i < LANES; i++) {
        at[i] = (float)((first + i) % columns) + 0.5f;
        down[i] = (float)((first + i) / columns) + 0.5f;
    }
    float16 place_x = vload16(0, at), place_y = vload16(0, down);
    float16 place_width = (float16)((float)columns), place_height = (float16)((float)rows);
#endif
    LOAD
    RESULTS
    planes_stream(y, out + first * OUT, OUT, count, pixels);
}
