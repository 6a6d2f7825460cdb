// Means of neighbouring frames; frame_blur.py is the definition.
//
// Every work-item follows SEGMENT samples of a frame through time. RUNNING 1: the sum takes what comes and gives back
// what goes; 0: every window is summed. Sums are of the type TOTAL.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define SEGMENT 64

kernel void means(global const float *restrict frames, global float *restrict out, ulong samples, int window, int stride,
                  int made)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT;
    if (first >= samples)
        return;
    int width = (int)min((ulong)SEGMENT, samples - first);
    TOTAL total[SEGMENT];
    for (int i = 0; i < SEGMENT; i++)
        total[i] = 0;
    for (int number = 0; number < made; number++) {
        int begin = number * stride;
#if RUNNING
        int known = number == 0 ? begin : begin - stride + window;
        for (int frame = begin - stride; number > 0 && frame < begin; frame++)
            for (int i = 0; i < width; i++)
                total[i] -= frames[(ulong)frame * samples + first + i];
#else
        int known = begin;
        for (int i = 0; i < SEGMENT; i++)
            total[i] = 0;
#endif
        for (int frame = known; frame < begin + window; frame++)
            for (int i = 0; i < width; i++)
                total[i] += frames[(ulong)frame * samples + first + i];
        for (int i = 0; i < width; i++)
            out[(ulong)number * samples + first + i] = (float)(total[i] / (TOTAL)window);
    }
}
