// Means of light over lobes about directions; prefilter.py is the definition.
//
// LOBE: 0 diffuse, 1 Phong, 2 GGX. CHANNELS of the light. `from` and `to` hold planes of x, y and z in doubles, so that no
// rounding decides which texels a lobe reaches; `count` texels, a multiple of 64, the last with no solid angle.

#include "numeric.clh"

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define SEGMENT 64
#define EACH for (int i = 0; i < SEGMENT; ++i)

kernel void means(global const double *restrict from, global const float *restrict angle,
                  global const float *restrict light, global const double *restrict to, global float *restrict out,
                  float sharpness, int count, int targets)
{
    int target = get_global_id(0);
    if (target >= targets)
        return;
    double x = to[target], y = to[targets + target], z = to[2 * targets + target];
    double best[SEGMENT];
    EACH best[i] = -2.0;
    for (int first = 0; first < count; first += SEGMENT)
        EACH {
            int at = first + i;
            double c = from[at] * x + from[count + at] * y + from[2 * count + at] * z;
            best[i] = c > best[i] ? c : best[i];
        }
    double most = best[0];
    for (int i = 1; i < SEGMENT; ++i)
        most = best[i] > most ? best[i] : most;
    double total[CHANNELS][SEGMENT], weights[SEGMENT];
    EACH {
        weights[i] = 0;
        for (int k = 0; k < CHANNELS; k++)
            total[k][i] = 0;
    }
    double inverse = 1 / most;
    for (int first = 0; first < count; first += SEGMENT) {
        float w[SEGMENT];
        EACH {
            int at = first + i;
            double c = from[at] * x + from[count + at] * y + from[2 * count + at] * z;
#if LOBE == 0
            float lobe = (float)c;
#elif LOBE == 1
            float lobe = num_pow((float)(c > 0 ? c * inverse : 0.0), sharpness);
#else
            float near = (float)((1 - c) / 2), t = near + sharpness * (1.0f - near);
            float closest = (float)((1 - most) / 2), least = closest + sharpness * (1.0f - closest), share = least / t;
            float lobe = (float)c * (share * share);
#endif
            w[i] = (most > 0 ? (c > 0 ? lobe : 0.0f) : 1.0f) * angle[at];
            weights[i] += w[i];
        }
        for (int k = 0; k < CHANNELS; k++)
            EACH total[k][i] += w[i] == 0.0f ? 0.0 : (double)w[i] * light[(size_t)k * count + first + i];
    }
    double all = 0;
    for (int i = 0; i < SEGMENT; ++i)
        all += weights[i];
    for (int k = 0; k < CHANNELS; k++) {
        double sum = 0;
        for (int i = 0; i < SEGMENT; ++i)
            sum += total[k][i];
        out[(size_t)target * CHANNELS + k] = (float)(sum / all);
    }
}
