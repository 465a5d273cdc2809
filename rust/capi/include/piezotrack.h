/*
 * Controllers and inverses of piezotrack.
 *
 * A controller is made from settings and stepped once in each sampling interval; a step does not
 * allocate. Several threads may each have controllers of their own; one controller belongs to one
 * thread at a time.
 */

#ifndef PIEZOTRACK_H
#define PIEZOTRACK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/**
 * A controller at work: its settings, and the state of all of its parts.
 */
typedef struct piezotrack_controller piezotrack_controller;

/**
 * A part, a parameter or a state, with its numbers.
 */
typedef struct {
  /**
   * Its name; NULL for none.
   */
  const char *name;
  /**
   * Its numbers.
   */
  const double *values;
  /**
   * How many there are.
   */
  size_t count;
} piezotrack_numbers;

/**
 * Parts of a controller, by name. Units are SI: m, V, s, Hz. What is 0 or NULL has its default, so
 * name what you set: `piezotrack_settings settings = {.dt = 0.001, .high = 75.0};`
 *
 * The feedback law is one of
 *
 * | name | values |
 * | --- | --- |
 * | "pid" | kp (V/m), ti, td (s), tt (s; NAN for its default) |
 * | "state-space" | n, then A row by row, B, C, D (V/m), and n for back-calculation or none |
 * | "lead-lag" | kp (V/m), lead, lag (s), 1 for matched poles or 0 |
 * | "sliding-mode" | switching gain (V), layer (m), ti, td, tf (s) |
 * | "disturbance-observer" | those of the PID; gain (m/V), time (s), cutoff (Hz) |
 * | "perturbation-estimator" | those of the sliding mode; gain (m/V), time (s), cutoff (Hz) |
 * | "scheduled-pid" | counts of amplitudes and rates, both (m, Hz), the first of each; PIDs |
 * | "hysteresis-observer" | those of the PID; gain (m/V), time (s), correction, stroke (m); a1, a2, curvature of a Dahl hysteresis, or rise, beta, gamma, exponent of a Bouc-Wen one |
 * | "integral-resonant" | those of the PID; gain (V/m/s), feedthrough (m/V) |
 * | "positive-position" | those of the PID; gain (V/m), frequency (Hz), damping ratio |
 * | "positive-velocity-position" | those of the PID; gains of velocity and position (V/m), frequency (Hz), damping ratio |
 */
typedef struct {
  /**
   * Sampling interval, s.
   */
  double dt;
  /**
   * Lowest voltage, V.
   */
  double low;
  /**
   * Highest voltage, V.
   */
  double high;
  /**
   * Lowest displacement that the sensor can show, m; both 0 for -10 to 10 mm.
   */
  double span_low;
  /**
   * Highest displacement that the sensor can show, m.
   */
  double span_high;
  /**
   * Largest displacement in a sampling interval, m; 0 for any.
   */
  double max_jump;
  /**
   * Feedback law.
   */
  piezotrack_numbers law;
  /**
   * Repetitive control: "lag", "compensated-lag", "zero-phase" or "none" for its smoothing, with
   * period (s), kq (V/m), time constant (s) or order, forgetting factor, lead (samples), 1 to
   * pause under saturation or 0.
   */
  piezotrack_numbers repetitive;
  /**
   * Filters of the measurement: "low-pass" with its cutoff (Hz), "notch" with frequency (Hz),
   * width and depth.
   */
  const piezotrack_numbers *filters;
  /**
   * How many there are, 2 at most.
   */
  size_t filter_count;
  /**
   * Model of the stage whose inverse is the feedforward, by its name as in Python
   * ("prandtl-ishlinskii"), or "neural network"; NULL for no feedforward. With it the filters of
   * the last three laws act on the deviation from the reference, also in `piezotrack_step_given`.
   */
  const char *model;
  /**
   * Parameters of the model, by their names; lists and what is optional may be left out. Names
   * and units are those of the stage's class in Python: "prandtl-ishlinskii" has `linear` (m/V),
   * `thresholds` (V) with `weights` (m/V), `dead_zone_thresholds` (m) with `dead_zone_weights`,
   * `creep_weights` with `creep_times` (s), and `time_constant` (s), or `frequency` (Hz) and
   * `damping_ratio`. `piezotrack export --to library` writes those of any controller. A "neural
   * network" has `centre`, 3 `scales`, `thresholds`, `hidden`, `biases`, `outputs`, `direct` and
   * `constant`, as `NetworkNumbers` of the crate.
   */
  const piezotrack_numbers *parameters;
  /**
   * How many there are.
   */
  size_t parameter_count;
  /**
   * State of the stage at the start, by the names of the model's states; NULL for a stage that
   * never moved.
   */
  const piezotrack_numbers *initial;
  /**
   * How many there are.
   */
  size_t initial_count;
  /**
   * Reading of the sensor where the stage rests without drive, m.
   */
  double offset;
  /**
   * Time by which the displacement lags behind the drive beyond the model, s.
   */
  double delay;
} piezotrack_settings;

/**
 * The command of a sample, with its parts.
 */
typedef struct {
  /**
   * The voltage for the actuator, within the limits, V.
   */
  double volts;
  /**
   * The voltage before it was clipped, V.
   */
  double unclipped;
  /**
   * Its feedforward part, V.
   */
  double feedforward;
  /**
   * Its feedback part, V.
   */
  double feedback;
  /**
   * Its repetitive part, V.
   */
  double repetitive;
  /**
   * Tracking error, m.
   */
  double error;
  /**
   * Whether the voltage was clipped.
   */
  bool saturated;
  /**
   * False where the reading was not finite, outside the span, or a jump too far.
   */
  bool measurement_ok;
  /**
   * False where the reference or the feedforward was not finite, or far outside.
   */
  bool reference_ok;
} piezotrack_command;

/**
 * Number of readings that were no measurements, since the start or the last reset.
 */
typedef struct {
  /**
   * NaN or infinite.
   */
  uint32_t not_finite;
  /**
   * Outside of the span.
   */
  uint32_t outside;
  /**
   * Further from the last valid reading than the settings allow.
   */
  uint32_t jumps;
} piezotrack_refused_readings;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * The version of the library.
 */
const char *piezotrack_version(void);

/**
 * Makes a controller that begins at 0 V, and NULL where it cannot: `message`, of `room` bytes,
 * then has a sentence that names the setting, its value and what was expected. It is "" otherwise;
 * it may be NULL. The settings are copied.
 *
 * # Safety
 * Each pointer of `settings` is NULL, points to as many elements as the count beside it says, or
 * to a text that ends with 0; `message` is NULL or has `room` bytes.
 */
piezotrack_controller *piezotrack_new(const piezotrack_settings *settings,
                                      char *message,
                                      size_t room);

/**
 * Frees a controller; nothing for NULL.
 *
 * # Safety
 * `controller` is NULL or from `piezotrack_new`, and is not used afterwards.
 */
void piezotrack_free(piezotrack_controller *controller);

/**
 * The voltage of a sample, V: once in each sampling interval. `reference` is the displacement to
 * be followed and `next` the same one sample ahead (NAN where it is not known), `measured` the
 * reading, all in m. The feedforward is the inverse of the settings, 0 V without one.
 *
 * A reading or a reference that cannot be used changes neither the command nor what is learnt. NAN
 * for NULL.
 *
 * # Safety
 * `controller` is NULL or from `piezotrack_new`, and no other thread uses it meanwhile.
 */
double piezotrack_step(piezotrack_controller *controller,
                       double reference,
                       double next,
                       double measured);

/**
 * The same with a feedforward of your own, as from a table, V; the inverse is not asked.
 *
 * # Safety
 * As of `piezotrack_step`.
 */
double piezotrack_step_given(piezotrack_controller *controller,
                             double reference,
                             double measured,
                             double feedforward);

/**
 * Begins anew without a bump at the voltage that is there, V. False where that is outside of the
 * limits, and for NULL.
 *
 * # Safety
 * As of `piezotrack_step`.
 */
bool piezotrack_start(piezotrack_controller *controller, double present);

/**
 * Reports the voltage that the amplifier in fact gave for the last command, V, where that is
 * another: for the antiwindup. False where it is not finite, and for NULL.
 *
 * # Safety
 * As of `piezotrack_step`.
 */
bool piezotrack_applied(piezotrack_controller *controller, double volts);

/**
 * Forgets errors, readings, hysteresis and what was learnt, and goes on from the voltage that is
 * there.
 *
 * # Safety
 * As of `piezotrack_step`.
 */
void piezotrack_reset(piezotrack_controller *controller);

/**
 * The last command with its parts; zeros for NULL.
 *
 * # Safety
 * As of `piezotrack_step`.
 */
piezotrack_command piezotrack_last(const piezotrack_controller *controller);

/**
 * Number of readings that were no measurements; zeros for NULL.
 *
 * # Safety
 * As of `piezotrack_step`.
 */
piezotrack_refused_readings piezotrack_refused(const piezotrack_controller *controller);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PIEZOTRACK_H */
