/* Curves, fits, a cancelled trace, merged and restored estimators of generated samples, printed as the bits of the numbers:
 * the same on every platform. */
#include "allan_core.h"
#include <stdio.h>
#include <string.h>

#define CHECK(call) check((call), #call)

static allan_24_8 large, later;
static allan_20_4 small_one, restored;
static allan_curve curve, unbounded;
static allan_trace_result traced;
static uint8_t saved[ALLAN_20_4_SAVED_SIZE];
static uint64_t state = 1;

static int check(allan_status status, const char *call) {
    if (status != ALLAN_OK) {
        printf("%s: %s\n", call, allan_status_text(status));
    }
    return status == ALLAN_OK;
}

/* White noise, uniform over 100 counts. */
static int32_t sample(void) {
    state = state * 16807 % 2147483647;
    return (int32_t)(state % 100);
}

static unsigned long long bits(double number) {
    uint64_t word;
    memcpy(&word, &number, sizeof word);
    return word;
}

static void print_curve(const char *name) {
    for (size_t index = 0; index < allan_curve_len(&curve); index++) {
        allan_point point;
        CHECK(allan_curve_point(&curve, index, &point));
        printf("%s %llu %llu %016llx %016llx %016llx %016llx %016llx %d\n", name, (unsigned long long)point.n,
               (unsigned long long)point.count, bits(point.tau), bits(point.avar), bits(point.low), bits(point.high),
               bits(point.edf), (int)point.power_law);
    }
}

static void print_terms(const char *name, const allan_model *model) {
    for (size_t index = 0; index < model->count; index++) {
        const allan_term *term = &model->terms[index];
        printf("%s %ld %016llx %016llx %016llx\n", name, (long)term->kind, bits(term->value), bits(term->low),
               bits(term->high));
    }
}

static void print_model(const char *name, const allan_model *model) {
    print_terms(name, model);
    printf("%s %016llx %016llx\n", name, bits(model->p_value), bits(allan_model_avar(model, 64)));
}

static bool a_few_times(void *context) {
    int *calls = context;
    return ++*calls < 4;
}

int main(void) {
    int32_t slice[1000];
    CHECK(allan_24_8_init(&large, sizeof large));
    CHECK(allan_24_8_init(&later, sizeof later));
    CHECK(allan_20_4_init(&small_one, sizeof small_one));
    CHECK(allan_20_4_init(&restored, sizeof restored));

    for (int k = 0; k < 5000; k++) {
        int32_t count = sample();
        CHECK(allan_24_8_push(&large, count));
        CHECK(allan_20_4_push(&small_one, -count));
    }
    CHECK(allan_24_8_gap(&large, 3));
    for (int block = 0; block < 5; block++) {
        for (int k = 0; k < 1000; k++) {
            slice[k] = sample();
        }
        CHECK(allan_24_8_push_slice(&large, slice, 1000));
        CHECK(allan_24_8_push_slice(&later, slice, 700));
    }

    size_t length = 0;
    CHECK(allan_20_4_save(&small_one, saved, sizeof saved, &length));
    CHECK(allan_20_4_restore(&restored, saved, length));
    CHECK(allan_20_4_push_slice(&restored, slice, 1000));
    CHECK(allan_20_4_curve(&restored, 0.005, 1.0, &curve));
    print_curve("restored");

    CHECK(allan_24_8_curve(&large, 0.01, 0.05, &curve));
    print_curve("large");
    allan_term terms[3] = {{.kind = ALLAN_ANGLE_RANDOM_WALK}, {.kind = ALLAN_BIAS_INSTABILITY}, {.kind = ALLAN_RATE_RANDOM_WALK}};
    allan_model model;
    CHECK(allan_fit(&curve, terms, 3, false, &model));
    print_model("fit", &model);
    CHECK(allan_24_8_curve_without_confidence(&large, 0.01, 0.05, &unbounded));
    CHECK(allan_fit_power_laws(&unbounded, terms, 3, &model));
    print_terms("power laws", &model);
    printf("power laws: p is NaN: %d\n", model.p_value != model.p_value);
    int calls = 0;
    printf("trace: %s", allan_status_text(allan_trace(&curve, NULL, 0, a_few_times, &calls, &traced)));
    printf(" after %d calls\n", calls);
    print_model("before", &traced.before);

    CHECK(allan_24_8_merge(&large, &later));
    CHECK(allan_24_8_curve(&large, 0.01, 0.05, &curve));
    print_curve("merged");
    printf("%llu samples, %llu missing, saturated %d\n", (unsigned long long)allan_24_8_len(&large),
           (unsigned long long)allan_24_8_missing(&large), (int)allan_24_8_is_saturated(&large));
    return 0;
}
