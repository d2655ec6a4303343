/* allan-core for C: streaming Allan variance, its confidence, and noise models fitted to it.
 *
 * Made by cbindgen from allan-core/ffi/src; a test checks that it is up to date. docs/c.md introduces it.
 * Licence: MIT or Apache-2.0, at your choice. */

#ifndef ALLAN_CORE_H
#define ALLAN_CORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/**
 * Alignment of every object in bytes.
 */
#define ALLAN_ALIGNMENT 8

/**
 * Bytes of an `allan_24_8`.
 */
#define ALLAN_24_8_SIZE 3592

/**
 * Bytes that `allan_24_8_save` needs at most.
 */
#define ALLAN_24_8_SAVED_SIZE 4500

/**
 * Bytes of an `allan_20_4`.
 */
#define ALLAN_20_4_SIZE 2344

/**
 * Bytes that `allan_20_4_save` needs at most.
 */
#define ALLAN_20_4_SAVED_SIZE 2940

/**
 * Bytes of an `allan_curve`.
 */
#define ALLAN_CURVE_SIZE 2720

/**
 * Largest number of terms of a model.
 */
#define ALLAN_MAX_TERMS 8

/**
 * Largest number of terms that a trace adds.
 */
#define ALLAN_MAX_ADDED 5

/**
 * Largest number of filters that a trace tries.
 */
#define ALLAN_MAX_FILTERS 64

/**
 * What a function returns: 0, or why it did nothing.
 */
typedef enum allan_status {
  /**
   * Done. 
   */
  ALLAN_OK = 0,
  /**
   * A pointer is null. 
   */
  ALLAN_ERROR_NULL = 1,
  /**
   * A pointer is not aligned to ALLAN_ALIGNMENT bytes, or as its type needs it. 
   */
  ALLAN_ERROR_ALIGNMENT = 2,
  /**
   * A buffer is smaller than it must be. 
   */
  ALLAN_ERROR_SIZE = 3,
  /**
   * An object was not initialised, or was overwritten. 
   */
  ALLAN_ERROR_UNINITIALISED = 4,
  /**
   * Two arguments are the same object. 
   */
  ALLAN_ERROR_SAME_OBJECT = 5,
  /**
   * A number is outside its range. 
   */
  ALLAN_ERROR_RANGE = 6,
  /**
   * There is no such kind of term, it is given twice, or there are too many terms. 
   */
  ALLAN_ERROR_KIND = 7,
  /**
   * An index is beyond the last. 
   */
  ALLAN_ERROR_INDEX = 8,
  /**
   * A saved state is damaged, or that of another type or version. 
   */
  ALLAN_ERROR_STATE = 9,
  /**
   * The callback ended the search; the result holds what was found. 
   */
  ALLAN_CANCELLED = 10,
  /**
   * A fault of the library. 
   */
  ALLAN_ERROR_INTERNAL = 11,
} allan_status;

/**
 * The noise that dominates around an averaging time.
 */
typedef enum allan_power_law {
  /**
   * Variance proportional to 1/tau^2. 
   */
  ALLAN_QUANTIZATION_NOISE = 0,
  /**
   * Variance proportional to 1/tau. 
   */
  ALLAN_WHITE_NOISE = 1,
  /**
   * Constant variance. 
   */
  ALLAN_FLICKER_NOISE = 2,
  /**
   * Variance proportional to tau. 
   */
  ALLAN_RANDOM_WALK_NOISE = 3,
} allan_power_law;

/**
 * Kinds of terms, with the unit of their coefficient in terms of the unit of the samples.
 */
typedef enum allan_kind {
  /**
   * Q: 3*Q^2/tau^2; unit*s. 
   */
  ALLAN_QUANTIZATION = 0,
  /**
   * N: N^2/tau; unit*sqrt(s). 
   */
  ALLAN_ANGLE_RANDOM_WALK = 1,
  /**
   * B: 2*ln(2)/pi*B^2; unit. 
   */
  ALLAN_BIAS_INSTABILITY = 2,
  /**
   * K: K^2*tau/3; unit/sqrt(s). 
   */
  ALLAN_RATE_RANDOM_WALK = 3,
  /**
   * R: R^2*tau^2/2; unit/s. 
   */
  ALLAN_RATE_RAMP = 4,
  /**
   * N after moving averages; shape: number of values that each averages, values per sample that is read. 
   */
  ALLAN_FILTERED = 5,
  /**
   * Standard deviation of exponentially correlated noise; shape: correlation time in s. 
   */
  ALLAN_MARKOV = 6,
  /**
   * Standard deviation of a damped oscillation; shape: frequency and bandwidth in Hz. 
   */
  ALLAN_RESONANCE = 7,
  /**
   * Amplitude of a sinusoid; shape: frequency in Hz. 
   */
  ALLAN_SINUSOID = 8,
  /**
   * N after a low-pass filter of the second order; shape: natural frequency in Hz, damping below 1. 
   */
  ALLAN_LOW_PASS = 9,
} allan_kind;

/**
 * An estimator of 24 octaves (averaging factors up to 2^23 samples) with 8-fold overlap. The content is the library's.
 */
typedef struct allan_24_8 {
  uint64_t words[449];
} allan_24_8;

/**
 * A curve with up to 24 points. The content is the library's; `allan_curve_point` reads it.
 */
typedef struct allan_curve {
  uint64_t words[340];
} allan_curve;

/**
 * An estimator of 20 octaves (averaging factors up to 2^19 samples) with 4-fold overlap. The content is the library's.
 */
typedef struct allan_20_4 {
  uint64_t words[293];
} allan_20_4;

/**
 * One averaging time of a curve.
 */
typedef struct allan_point {
  /**
   * Averaging factor, samples.
   */
  uint64_t n;
  /**
   * Averaging time, s.
   */
  double tau;
  /**
   * Allan variance, in the square of the unit.
   */
  double avar;
  /**
   * Lower 95 % bound of `avar`.
   */
  double low;
  /**
   * Upper 95 % bound of `avar`.
   */
  double high;
  /**
   * Equivalent degrees of freedom of `avar`.
   */
  double edf;
  /**
   * Number of differences that `avar` is the mean of.
   */
  uint64_t count;
  /**
   * Share of the samples that was replaced because it was missing.
   */
  double replaced;
  /**
   * Excess kurtosis of the differences; NaN where it is not known.
   */
  double kurtosis;
  /**
   * The noise that dominates.
   */
  enum allan_power_law power_law;
} allan_point;

/**
 * A term: `kind`, `stages` and `shape` are set before a fit, the rest is its result.
 */
typedef struct allan_term {
  /**
   * An `allan_kind`.
   */
  int32_t kind;
  /**
   * Of ALLAN_FILTERED: number of cascaded moving averages, 1 or 2.
   */
  uint32_t stages;
  /**
   * Coefficient; 0 if the data does not show the term.
   */
  double value;
  /**
   * Lower 95 % bound.
   */
  double low;
  /**
   * Upper 95 % bound.
   */
  double high;
  /**
   * Shape parameters; see `allan_kind`.
   */
  double shape[2];
  /**
   * Their lower 95 % bounds.
   */
  double shape_low[2];
  /**
   * Their upper 95 % bounds.
   */
  double shape_high[2];
} allan_term;

/**
 * A fitted model.
 */
typedef struct allan_model {
  /**
   * Seconds between samples.
   */
  double sample_period;
  /**
   * Probability of a deviance at least as large if the model is true.
   */
  double p_value;
  /**
   * Number of terms.
   */
  size_t count;
  /**
   * The terms, of which the first `count` are set.
   */
  struct allan_term terms[8];
} allan_model;

/**
 * A term that the baseline model lacked.
 */
typedef struct allan_added {
  /**
   * Index of the term in the final model.
   */
  size_t term;
  /**
   * Decrease of the deviance in units of its scatter: a squared significance.
   */
  double score;
  /**
   * Averaging factor of the largest residual before the term was added.
   */
  uint64_t n;
  /**
   * That residual in standard deviations.
   */
  double sigmas;
} allan_added;

/**
 * The result of `allan_trace`.
 */
typedef struct allan_trace_result {
  /**
   * N, B and K.
   */
  struct allan_model before;
  /**
   * The model with the added terms.
   */
  struct allan_model after;
  /**
   * Number of added terms.
   */
  size_t count;
  /**
   * The added terms, of which the first `count` are set.
   */
  struct allan_added added[5];
} allan_trace_result;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * What a status means, in English. Never null; the text is constant.
 */
const char *allan_status_text(int32_t status);

/**
 * Makes an estimator without samples in `bytes` bytes of memory, usually `sizeof(allan_24_8)`; it may hold anything, another
 * estimator too.
 *
 * # Safety
 * `estimator` is null or points to `bytes` bytes that the caller may write.
 */
enum allan_status allan_24_8_init(struct allan_24_8 *estimator,
                                  size_t bytes);

/**
 * Adds the next sample, in counts.
 *
 * # Safety
 * `estimator` is null or points to memory of its type, which no other code uses during the call.
 */
enum allan_status allan_24_8_push(struct allan_24_8 *estimator, int32_t sample);

/**
 * Adds `count` samples in order.
 *
 * # Safety
 * As `allan_24_8_push`; `samples` is null or points to `count` samples.
 */
enum allan_status allan_24_8_push_slice(struct allan_24_8 *estimator, const int32_t *samples, size_t count);

/**
 * Says that `missing` samples are missing before the next one. Calls add up.
 *
 * # Safety
 * As `allan_24_8_push`.
 */
enum allan_status allan_24_8_gap(struct allan_24_8 *estimator, uint32_t missing);

/**
 * Adds the sums of `later`, which has seen a later stretch of the same channel. They must be different objects.
 *
 * # Safety
 * As `allan_24_8_push`; no other code writes `later` during the call.
 */
enum allan_status allan_24_8_merge(struct allan_24_8 *estimator,
                                   const struct allan_24_8 *later);

/**
 * Samples taken; 0 if `estimator` is not an estimator.
 *
 * # Safety
 * `estimator` is null or points to memory of its type, which no other code writes during the call.
 */
uint64_t allan_24_8_len(const struct allan_24_8 *estimator);

/**
 * Samples reported missing; 0 if `estimator` is not an estimator.
 *
 * # Safety
 * As `allan_24_8_len`.
 */
uint64_t allan_24_8_missing(const struct allan_24_8 *estimator);

/**
 * Whether a sum of squares is full, so that the curve is a lower bound there.
 *
 * # Safety
 * As `allan_24_8_len`.
 */
bool allan_24_8_is_saturated(const struct allan_24_8 *estimator);

/**
 * Makes `curve` the Allan variance of every octave that has a difference, for samples every `sample_period` seconds, in
 * units of `lsb` units per count.
 *
 * # Safety
 * As `allan_24_8_len`; `curve` is null or points to memory of its type that the caller may write.
 */
enum allan_status allan_24_8_curve(const struct allan_24_8 *estimator,
                                   double sample_period,
                                   double lsb,
                                   struct allan_curve *curve);

/**
 * As `allan_24_8_curve`, in single precision and without confidence: `low` is 0, `high` infinite, `kurtosis` NaN,
 * `power_law` white noise, and `edf` the number of differences that do not overlap. It takes a small part of the
 * instructions and of the code; the fits give nearly the same coefficients.
 *
 * # Safety
 * As `allan_24_8_curve`.
 */
enum allan_status allan_24_8_curve_without_confidence(const struct allan_24_8 *estimator,
                                                      double sample_period,
                                                      double lsb,
                                                      struct allan_curve *curve);

/**
 * Writes the whole state, with version and checksum, into `buffer` and its length into `length`.
 * `ALLAN_24_8_SAVED_SIZE` bytes are always enough.
 *
 * # Safety
 * As `allan_24_8_len`; `buffer` is null or points to `capacity` bytes, `length` to a number, that the caller may write.
 */
enum allan_status allan_24_8_save(const struct allan_24_8 *estimator,
                                  uint8_t *buffer,
                                  size_t capacity,
                                  size_t *length);

/**
 * Replaces the state of an initialised estimator by a saved one, which continues to the bit. The estimator stays as it was
 * if the state is refused, unless it has a correct checksum over sums that no samples lead to: then it is empty.
 *
 * # Safety
 * As `allan_24_8_push`; `state` is null or points to `length` bytes.
 */
enum allan_status allan_24_8_restore(struct allan_24_8 *estimator,
                                     const uint8_t *state,
                                     size_t length);

/**
 * Makes an estimator without samples in `bytes` bytes of memory, usually `sizeof(allan_20_4)`; it may hold anything, another
 * estimator too.
 *
 * # Safety
 * `estimator` is null or points to `bytes` bytes that the caller may write.
 */
enum allan_status allan_20_4_init(struct allan_20_4 *estimator,
                                  size_t bytes);

/**
 * Adds the next sample, in counts.
 *
 * # Safety
 * `estimator` is null or points to memory of its type, which no other code uses during the call.
 */
enum allan_status allan_20_4_push(struct allan_20_4 *estimator, int32_t sample);

/**
 * Adds `count` samples in order.
 *
 * # Safety
 * As `allan_20_4_push`; `samples` is null or points to `count` samples.
 */
enum allan_status allan_20_4_push_slice(struct allan_20_4 *estimator, const int32_t *samples, size_t count);

/**
 * Says that `missing` samples are missing before the next one. Calls add up.
 *
 * # Safety
 * As `allan_20_4_push`.
 */
enum allan_status allan_20_4_gap(struct allan_20_4 *estimator, uint32_t missing);

/**
 * Adds the sums of `later`, which has seen a later stretch of the same channel. They must be different objects.
 *
 * # Safety
 * As `allan_20_4_push`; no other code writes `later` during the call.
 */
enum allan_status allan_20_4_merge(struct allan_20_4 *estimator,
                                   const struct allan_20_4 *later);

/**
 * Samples taken; 0 if `estimator` is not an estimator.
 *
 * # Safety
 * `estimator` is null or points to memory of its type, which no other code writes during the call.
 */
uint64_t allan_20_4_len(const struct allan_20_4 *estimator);

/**
 * Samples reported missing; 0 if `estimator` is not an estimator.
 *
 * # Safety
 * As `allan_20_4_len`.
 */
uint64_t allan_20_4_missing(const struct allan_20_4 *estimator);

/**
 * Whether a sum of squares is full, so that the curve is a lower bound there.
 *
 * # Safety
 * As `allan_20_4_len`.
 */
bool allan_20_4_is_saturated(const struct allan_20_4 *estimator);

/**
 * Makes `curve` the Allan variance of every octave that has a difference, for samples every `sample_period` seconds, in
 * units of `lsb` units per count.
 *
 * # Safety
 * As `allan_20_4_len`; `curve` is null or points to memory of its type that the caller may write.
 */
enum allan_status allan_20_4_curve(const struct allan_20_4 *estimator,
                                   double sample_period,
                                   double lsb,
                                   struct allan_curve *curve);

/**
 * As `allan_20_4_curve`, in single precision and without confidence: `low` is 0, `high` infinite, `kurtosis` NaN,
 * `power_law` white noise, and `edf` the number of differences that do not overlap. It takes a small part of the
 * instructions and of the code; the fits give nearly the same coefficients.
 *
 * # Safety
 * As `allan_20_4_curve`.
 */
enum allan_status allan_20_4_curve_without_confidence(const struct allan_20_4 *estimator,
                                                      double sample_period,
                                                      double lsb,
                                                      struct allan_curve *curve);

/**
 * Writes the whole state, with version and checksum, into `buffer` and its length into `length`.
 * `ALLAN_20_4_SAVED_SIZE` bytes are always enough.
 *
 * # Safety
 * As `allan_20_4_len`; `buffer` is null or points to `capacity` bytes, `length` to a number, that the caller may write.
 */
enum allan_status allan_20_4_save(const struct allan_20_4 *estimator,
                                  uint8_t *buffer,
                                  size_t capacity,
                                  size_t *length);

/**
 * Replaces the state of an initialised estimator by a saved one, which continues to the bit. The estimator stays as it was
 * if the state is refused, unless it has a correct checksum over sums that no samples lead to: then it is empty.
 *
 * # Safety
 * As `allan_20_4_push`; `state` is null or points to `length` bytes.
 */
enum allan_status allan_20_4_restore(struct allan_20_4 *estimator,
                                     const uint8_t *state,
                                     size_t length);

/**
 * Sets `count` to the count of a value in a unit: `(value - origin)/lsb`, rounded to nearest, ties up.
 *
 * `origin` is best near the mean of the values: the Allan variance does not depend on it. An `lsb` of a quarter of the
 * standard deviation of the noise, or less, costs nothing that matters; give it to the functions that make a curve.
 * `ALLAN_ERROR_RANGE` if the value is not finite or more than 2^31 counts from the origin, or `lsb` is not positive.
 *
 * # Safety
 * `count` is null or points to a number that the caller may write.
 */
enum allan_status allan_count(double value,
                              double origin,
                              double lsb,
                              int32_t *count);

/**
 * Number of points; 0 if `curve` is not a curve.
 *
 * # Safety
 * `curve` is null or points to memory of its type, which no other code writes during the call.
 */
size_t allan_curve_len(const struct allan_curve *curve);

/**
 * Copies the point with this index, 0 for the shortest averaging time, into `point`.
 *
 * # Safety
 * As `allan_curve_len`; `point` is null or points to memory of its type that the caller may write.
 */
enum allan_status allan_curve_point(const struct allan_curve *curve, size_t index, struct allan_point *point);

/**
 * Fits the coefficients of `count` terms to `curve`, and their shapes too if `shapes` is true. Of each term, `kind` and
 * where it has one the shape are read.
 *
 * # Safety
 * `curve` and `terms` are null or point to a curve and to `count` terms, which no other code writes during the call; `model` is
 * null or points to memory of its type that the caller may write.
 */
enum allan_status allan_fit(const struct allan_curve *curve,
                            const struct allan_term *terms,
                            size_t count,
                            bool shapes,
                            struct allan_model *model);

/**
 * Fits the coefficients of `count` power laws, ALLAN_QUANTIZATION to ALLAN_RATE_RAMP, in single precision, with bounds
 * that need none of the curve's. The `p_value` of the model is NaN. A program that calls no other fit links half of the
 * code.
 *
 * # Safety
 * As `allan_fit`.
 */
enum allan_status allan_fit_power_laws(const struct allan_curve *curve,
                                       const struct allan_term *terms,
                                       size_t count,
                                       struct allan_model *model);

/**
 * Modelled Allan variance at averaging factor `n`; NaN if `model` is not a model or `n` is 0.
 *
 * # Safety
 * `model` is null or points to a model, which no other code writes during the call.
 */
double allan_model_avar(const struct allan_model *model, uint64_t n);

/**
 * Fits N, B and K to `curve` and adds the terms that are missing, the most significant first.
 *
 * `filters` are `count` terms of the kind ALLAN_FILTERED that the sensor may have, at most ALLAN_MAX_FILTERS. `keep_on` is
 * called with `context` between the fits and may do other work; if it returns false, the search ends with
 * ALLAN_CANCELLED. It may be null. It must return: neither longjmp nor an exception may leave it.
 *
 * # Safety
 * `curve` and `filters` are null or point to a curve and to `count` terms, which no other code writes during the call; `result` is
 * null or points to memory of its type that the caller may write.
 */
enum allan_status allan_trace(const struct allan_curve *curve,
                              const struct allan_term *filters,
                              size_t count,
                              bool (*keep_on)(void *context),
                              void *context,
                              struct allan_trace_result *result);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ALLAN_CORE_H */
