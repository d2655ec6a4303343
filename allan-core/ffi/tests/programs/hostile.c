/* Wrong arguments: each call returns its status, and nothing is read or written out of bounds. To be run with the address
 * and undefined-behaviour sanitizers. */
#include "allan_core.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures;

static void expect(int expected, int found, int line) {
    if (expected != found) {
        printf("line %d: %s (%d) where there should be %s (%d)\n", line, allan_status_text(found), found,
               allan_status_text(expected), expected);
        failures++;
    }
}
#define EXPECT(expected, call) expect((int)(expected), (int)(call), __LINE__)

static bool keep_on(void *context) {
    (void)context;
    return true;
}

int main(void) {
    /* On the heap, of exactly their size, so that the address sanitizer sees a byte too much. */
    allan_24_8 *estimator = malloc(sizeof *estimator);
    allan_24_8 *other = malloc(sizeof *other);
    allan_20_4 *small_one = malloc(sizeof *small_one);
    allan_curve *curve = malloc(sizeof *curve);
    allan_model model;
    allan_trace_result *traced = malloc(sizeof *traced);
    allan_point point;
    int32_t samples[4] = {1, 2, 3, 4};
    size_t length;
    memset(estimator, 0xAA, sizeof *estimator);
    memset(curve, 0xAA, sizeof *curve);

    /* Before the initialisation. */
    EXPECT(ALLAN_ERROR_UNINITIALISED, allan_24_8_push(estimator, 1));
    EXPECT(ALLAN_ERROR_UNINITIALISED, allan_24_8_curve(estimator, 1.0, 1.0, curve));
    EXPECT(ALLAN_ERROR_UNINITIALISED, allan_curve_point(curve, 0, &point));
    EXPECT(0, allan_24_8_len(estimator));
    EXPECT(0, allan_curve_len(curve));

    /* The initialisation: too short, null, misaligned, twice. */
    EXPECT(ALLAN_ERROR_SIZE, allan_24_8_init(estimator, sizeof *estimator - 1));
    EXPECT(ALLAN_ERROR_SIZE, allan_24_8_init(estimator, 0));
    EXPECT(ALLAN_ERROR_NULL, allan_24_8_init(NULL, sizeof *estimator));
    unsigned char *bytes = malloc(sizeof *estimator + 8);
    EXPECT(ALLAN_ERROR_ALIGNMENT, allan_24_8_init((void *)(bytes + 4), sizeof *estimator));
    EXPECT(ALLAN_ERROR_ALIGNMENT, allan_24_8_push((void *)(bytes + 4), 1));
    free(bytes);
    EXPECT(ALLAN_OK, allan_24_8_init(estimator, sizeof *estimator));
    EXPECT(ALLAN_OK, allan_24_8_push_slice(estimator, samples, 4));
    EXPECT(4, allan_24_8_len(estimator));
    EXPECT(ALLAN_OK, allan_24_8_init(estimator, sizeof *estimator));
    EXPECT(0, allan_24_8_len(estimator));

    /* Another type in the memory of this one. */
    EXPECT(ALLAN_OK, allan_20_4_init(small_one, sizeof *small_one));
    EXPECT(ALLAN_ERROR_UNINITIALISED, allan_24_8_push((void *)small_one, 1));

    /* Slices. */
    EXPECT(ALLAN_OK, allan_24_8_push_slice(estimator, NULL, 0));
    EXPECT(ALLAN_ERROR_NULL, allan_24_8_push_slice(estimator, NULL, 4));
    EXPECT(ALLAN_ERROR_ALIGNMENT, allan_24_8_push_slice(estimator, (void *)((char *)samples + 1), 2));
    EXPECT(ALLAN_ERROR_SIZE, allan_24_8_push_slice(estimator, samples, SIZE_MAX));
    EXPECT(0, allan_24_8_len(estimator));

    /* Gaps as long as they can be, and samples at the ends of the range. */
    for (int k = 0; k < 100; k++) {
        EXPECT(ALLAN_OK, allan_24_8_push(estimator, k % 2 ? INT32_MAX : INT32_MIN));
        EXPECT(ALLAN_OK, allan_24_8_gap(estimator, UINT32_MAX));
    }
    EXPECT(ALLAN_OK, allan_24_8_push_slice(estimator, samples, 4));
    EXPECT(ALLAN_OK, allan_24_8_curve(estimator, 1.0, 1.0, curve));

    /* Merging with itself, with nothing. */
    EXPECT(ALLAN_ERROR_SAME_OBJECT, allan_24_8_merge(estimator, estimator));
    EXPECT(ALLAN_ERROR_NULL, allan_24_8_merge(estimator, NULL));
    EXPECT(ALLAN_ERROR_NULL, allan_24_8_merge(NULL, NULL));
    memset(other, 0, sizeof *other);
    EXPECT(ALLAN_ERROR_UNINITIALISED, allan_24_8_merge(estimator, other));

    /* Numbers outside their range. */
    const double wrong[] = {0.0, -1.0, NAN, INFINITY};
    for (int k = 0; k < 4; k++) {
        EXPECT(ALLAN_ERROR_RANGE, allan_24_8_curve(estimator, wrong[k], 1.0, curve));
        EXPECT(ALLAN_ERROR_RANGE, allan_24_8_curve(estimator, 1.0, wrong[k], curve));
        EXPECT(ALLAN_ERROR_RANGE, allan_24_8_curve_without_confidence(estimator, wrong[k], 1.0, curve));
        EXPECT(ALLAN_ERROR_RANGE, allan_24_8_curve_without_confidence(estimator, 1.0, wrong[k], curve));
    }
    EXPECT(ALLAN_ERROR_NULL, allan_24_8_curve_without_confidence(estimator, 1.0, 1.0, NULL));
    EXPECT(ALLAN_ERROR_NULL, allan_24_8_curve_without_confidence(NULL, 1.0, 1.0, curve));
    EXPECT(ALLAN_ERROR_NULL, allan_24_8_curve(estimator, 1.0, 1.0, NULL));
    EXPECT(ALLAN_ERROR_INDEX, allan_curve_point(curve, allan_curve_len(curve), &point));
    EXPECT(ALLAN_ERROR_INDEX, allan_curve_point(curve, SIZE_MAX, &point));
    EXPECT(ALLAN_ERROR_NULL, allan_curve_point(curve, 0, NULL));

    /* Fits of curves without information, and of terms that do not exist. */
    EXPECT(ALLAN_OK, allan_24_8_init(estimator, sizeof *estimator));
    allan_term terms[9];
    memset(terms, 0, sizeof terms);
    for (int k = 0; k < 9; k++) {
        terms[k].kind = k;
    }
    EXPECT(ALLAN_OK, allan_24_8_curve(estimator, 1.0, 1.0, curve)); /* without points */
    EXPECT(ALLAN_OK, allan_fit(curve, terms, 5, false, &model));
    EXPECT(ALLAN_OK, allan_fit_power_laws(curve, terms, 5, &model));
    EXPECT(ALLAN_OK, allan_trace(curve, NULL, 0, NULL, NULL, traced));
    for (int k = 0; k < 5000; k++) {
        EXPECT(ALLAN_OK, allan_24_8_push(estimator, 7)); /* never changes */
    }
    EXPECT(ALLAN_OK, allan_24_8_curve(estimator, 1.0, 1.0, curve));
    EXPECT(ALLAN_OK, allan_fit(curve, terms, 5, false, &model));
    EXPECT(0, model.terms[1].value != 0.0);
    EXPECT(ALLAN_OK, allan_24_8_curve_without_confidence(estimator, 1.0, 1.0, curve));
    EXPECT(ALLAN_OK, allan_fit_power_laws(curve, terms, 5, &model));
    EXPECT(0, model.terms[1].value != 0.0);
    EXPECT(ALLAN_ERROR_KIND, allan_fit_power_laws(curve, terms, 0, &model));
    EXPECT(ALLAN_ERROR_KIND, allan_fit_power_laws(curve, terms, 6, &model)); /* no power law */
    EXPECT(ALLAN_ERROR_NULL, allan_fit_power_laws(NULL, terms, 1, &model));
    EXPECT(ALLAN_ERROR_NULL, allan_fit_power_laws(curve, NULL, 1, &model));
    EXPECT(ALLAN_ERROR_NULL, allan_fit_power_laws(curve, terms, 1, NULL));
    EXPECT(ALLAN_OK, allan_trace(curve, NULL, 0, keep_on, NULL, traced));
    EXPECT(ALLAN_ERROR_KIND, allan_fit(curve, terms, 0, false, &model));
    EXPECT(ALLAN_ERROR_KIND, allan_fit(curve, terms, 9, false, &model));
    EXPECT(ALLAN_ERROR_RANGE, allan_fit(curve, terms, 7, false, &model)); /* no shape */
    EXPECT(ALLAN_ERROR_RANGE, allan_trace(curve, terms + 5, 1, NULL, NULL, traced));
    EXPECT(ALLAN_ERROR_KIND, allan_trace(curve, terms, 1, NULL, NULL, traced));
    EXPECT(ALLAN_ERROR_NULL, allan_trace(curve, NULL, 1, NULL, NULL, traced));
    EXPECT(ALLAN_ERROR_NULL, allan_trace(curve, NULL, 0, NULL, NULL, NULL));
    terms[1].kind = 0;
    EXPECT(ALLAN_ERROR_KIND, allan_fit(curve, terms, 2, false, &model)); /* twice */
    terms[1].kind = INT32_MIN;
    EXPECT(ALLAN_ERROR_KIND, allan_fit(curve, terms, 2, false, &model));
    EXPECT(ALLAN_ERROR_KIND, allan_fit_power_laws(curve, terms, 2, &model));
    EXPECT(ALLAN_ERROR_NULL, allan_fit(curve, NULL, 2, false, &model));
    EXPECT(ALLAN_ERROR_NULL, allan_fit(curve, terms, 1, false, NULL));
    model.count = SIZE_MAX;
    EXPECT(1, isnan(allan_model_avar(&model, 1)) != 0);
    EXPECT(1, isnan(allan_model_avar(NULL, 1)) != 0);

    /* States: too small a buffer, cut off, changed, of another type, zeros. */
    unsigned char *saved = malloc(ALLAN_24_8_SAVED_SIZE);
    EXPECT(ALLAN_ERROR_NULL, allan_24_8_save(estimator, NULL, ALLAN_24_8_SAVED_SIZE, &length));
    EXPECT(ALLAN_ERROR_NULL, allan_24_8_save(estimator, saved, ALLAN_24_8_SAVED_SIZE, NULL));
    EXPECT(ALLAN_OK, allan_24_8_save(estimator, saved, ALLAN_24_8_SAVED_SIZE, &length));
    unsigned char *small_buffer = malloc(length - 1);
    size_t unused;
    EXPECT(ALLAN_ERROR_SIZE, allan_24_8_save(estimator, small_buffer, length - 1, &unused));
    EXPECT(ALLAN_ERROR_SIZE, allan_24_8_save(estimator, small_buffer, 0, &unused));
    memcpy(small_buffer, saved, length - 1);
    EXPECT(ALLAN_ERROR_STATE, allan_24_8_restore(estimator, small_buffer, length - 1));
    EXPECT(ALLAN_ERROR_STATE, allan_24_8_restore(estimator, small_buffer, 0));
    EXPECT(ALLAN_ERROR_STATE, allan_20_4_restore(small_one, saved, length));
    for (size_t k = 0; k < length; k++) {
        saved[k] ^= 0x10;
        EXPECT(ALLAN_ERROR_STATE, allan_24_8_restore(estimator, saved, length));
        saved[k] ^= 0x10;
    }
    EXPECT(5000, allan_24_8_len(estimator)); /* as it was */
    EXPECT(ALLAN_OK, allan_24_8_restore(estimator, saved, length));
    memset(saved, 0, length);
    EXPECT(ALLAN_ERROR_STATE, allan_24_8_restore(estimator, saved, length));
    EXPECT(ALLAN_ERROR_NULL, allan_24_8_restore(estimator, NULL, length));

    /* Values that have no count. */
    int32_t count = 0;
    EXPECT(ALLAN_OK, allan_count(1.125, 1.0, 0.25, &count)); /* half a count, up */
    EXPECT(1, count);
    EXPECT(ALLAN_ERROR_RANGE, allan_count(NAN, 0.0, 1.0, &count));
    EXPECT(ALLAN_ERROR_RANGE, allan_count(INFINITY, 0.0, 1.0, &count));
    EXPECT(ALLAN_ERROR_RANGE, allan_count(3e9, 0.0, 1.0, &count));
    EXPECT(ALLAN_ERROR_RANGE, allan_count(1.0, 0.0, 0.0, &count));
    EXPECT(ALLAN_ERROR_RANGE, allan_count(1.0, NAN, 1.0, &count));
    EXPECT(ALLAN_ERROR_NULL, allan_count(1.0, 0.0, 1.0, NULL));
    EXPECT(1, count);

    EXPECT(0, strcmp(allan_status_text(12345), "no status of this library"));
    free(small_buffer);
    free(saved);
    free(traced);
    free(curve);
    free(small_one);
    free(other);
    free(estimator);
    return failures != 0;
}
