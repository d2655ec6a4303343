/* A firmware that only links: what a program takes of the flash by the functions that it calls. */
#include "allan_core.h"

static allan_24_8 estimator;
static allan_curve curve;
static allan_model model;
volatile int32_t input;
volatile double output;

void reset(void) {
    allan_24_8_init(&estimator, sizeof estimator);
    (void)curve; /* not used by all */
    for (;;) {
        allan_24_8_push(&estimator, input);
        allan_24_8_gap(&estimator, (uint32_t)input);
        allan_term term = {.kind = ALLAN_ANGLE_RANDOM_WALK};
#if defined VARIANCES || defined POWER_LAWS
        allan_24_8_curve_without_confidence(&estimator, 0.01, 0.05, &curve);
#elif defined CURVE || defined FIT
        allan_24_8_curve(&estimator, 0.01, 0.05, &curve);
#endif
#if defined POWER_LAWS
        allan_fit_power_laws(&curve, &term, 1, &model);
#elif defined FIT
        allan_fit(&curve, &term, 1, false, &model);
#endif
        output = model.terms[0].value + term.value;
    }
}
